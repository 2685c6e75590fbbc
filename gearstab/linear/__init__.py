"""What stability and response share: the first-order form, the smooth intervals of a period, Magnus steps."""
