"""One run from request to report: preparation, the loop, files, and a dm_env environment."""
