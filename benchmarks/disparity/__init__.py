"""How good disparity is, beside OpenCV's matchers as they come."""
