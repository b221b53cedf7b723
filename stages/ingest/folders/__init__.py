"""What layouts of folders share: their files, calibrations, pose lists, and frames that are loaded one at a time."""
