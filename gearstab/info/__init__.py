"""Facts about a system before a sweep and about a result after it: facts, and the text that says them."""
