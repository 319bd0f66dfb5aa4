"""Score: what each effect would gain, before and beside any refit."""
