"""The paper audited: its equations as printed, beside what they should be, each difference with a number that decides.

`rows` says what a row is. The print and the evidence, by the paper's order: `section2`, `permanent` (on `oscillator`);
`printed_car`, `car`, `assumptions`; `section3`, `modal`, `small_parameter`, `averaging`, `amplitude_equation`,
`resonance`; `section4` and `senses`. `response` runs the printed car; `document` writes it all down.
"""
