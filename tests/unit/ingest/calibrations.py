"""The tiny room's camera as other tools write it."""

ORB_SLAM = (
    '%YAML:1.0\n\n# Camera\nCamera.type: "PinHole"\nCamera.fx: 80.0\nCamera.fy: 80.0\nCamera.cx: 47.5\n'
    "Camera.cy: 35.5\n"
    "Camera.k1: 0.0\nCamera.k2: 0.0\nCamera.p1: 0.0\nCamera.p2: 0.0\nCamera.width: 96\nCamera.height: 72\n"
    "Camera.fps: 30.0\nCamera.bf: 40.0\nDepthMapFactor: 1000.0\n"
)
CAMODOCAL = (
    "%YAML:1.0\n---\nmodel_type: PINHOLE\ncamera_name: cam0\nimage_width: 96\nimage_height: 72\n"
    "distortion_parameters:\n   k1: 0.0\n   k2: 0.0\n   p1: 0.0\n   p2: 0.0\n"
    "projection_parameters:\n   fx: 80.0\n   fy: 80.0\n   cx: 47.5\n   cy: 35.5\n"
)
