"""Parts that survive a crash, and the result file that they become."""
