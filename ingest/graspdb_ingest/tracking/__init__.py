"""Hand tracking: the paper's section II.A, after Fu and Santello (2010)."""
