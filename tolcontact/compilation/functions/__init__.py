"""Ways to call a Function for many realizations: interpreted by CasADi, or compiled to machine code."""
