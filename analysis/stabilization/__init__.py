"""Optimal stabilization, §4: the regulator solved two ways, the half car, and how robust its control is.

`regulator`, `pontryagin`, `limit`, `margins` and `certified` take matrices and know no car; `half_car` and `full_car`
bring it; `document` writes it all down.
"""
