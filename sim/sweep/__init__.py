"""Many runs in drawn worlds: design, episodes on workers, rows, rates."""
