"""How do we infer? Filters, noise, identifiability; knows no rudder."""
