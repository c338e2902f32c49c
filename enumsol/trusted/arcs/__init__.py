"""The trusted core over alpha: selections as functions of alpha, and subintervals with one branch."""
