"""What strangers bring: situations out of public trackers, each rebuilt small, with its right value.

A case passes when the command gives the right value, or says in a line that helps what it could not read. Wrong
without a word, and advice that leads to something wrong, fail.
"""
