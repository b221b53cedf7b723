"""Section `made`: the record of every artifact."""
