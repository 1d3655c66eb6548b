"""What a run did and what it is worth: contact monitor, judge, report."""
