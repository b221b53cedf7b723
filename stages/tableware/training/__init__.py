"""What `tableware` is fitted by."""
