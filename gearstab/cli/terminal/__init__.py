"""What commands share: options, what is printed where, errors and exit codes, progress."""
