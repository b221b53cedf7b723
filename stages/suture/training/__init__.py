"""What `suture` is trained and fitted by."""
