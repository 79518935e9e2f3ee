"""The car with seven degrees of freedom: its parameters, its equations of motion, and its FMU."""
