"""Many episodes in many worlds: how often each controller succeeds, and why it fails where not."""
