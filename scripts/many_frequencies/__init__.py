"""Scripts about trains of many mesh frequencies."""
