"""Parts that commands share: options, output, errors and exit codes, progress."""
