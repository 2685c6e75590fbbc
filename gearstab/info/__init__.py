"""What is known of a system before a sweep, and of a result after it: facts, and the text that says them."""
