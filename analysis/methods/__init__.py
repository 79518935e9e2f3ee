"""The methods of §2 and §3: they take the standard form (2.1) and know no car."""
