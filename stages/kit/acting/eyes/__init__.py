"""What robots see by: masks of a picture, told by a simulated segmenter that errs or by a segmentation service."""
