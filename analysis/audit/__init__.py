"""The paper audited: its equations as printed, beside what they should be, each difference with a number that decides.

`rows` says what a row is; `printed_car`, `car`, `section2`, `section3`, `section4` hold the print and the evidence;
`response` runs the printed car; `document` writes it all down.
"""
