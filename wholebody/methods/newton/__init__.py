"""Newton's method in full coordinates (Choi and Cremer 1999), for figures and for assemblies with closed loops.

Every body has seven variables and every joint is an equation (`batches`, `figure_bodies`, `terms`, `assembly`). A
step is the least motion that satisfies the linearised equations: a regularised Gauss-Newton (Levenberg-Marquardt)
step for goals, which are soft, and a Newton step for equality constraints (`iteration`; Nocedal and Wright 2006,
sections 10.3 and 18.1). A funnel accepts it: it lowers the goals' errors while the constraints stay within the
funnel, or it restores feasibility (Gould and Toint 2010). Limits and contacts are an active set by squared slacks, or
a logarithmic barrier (`inequalities`; sections 16.5 and 19.1). The KKT systems are solved by sparse
Cholesky of the normal equations (`linear_algebra`; section 16.2). From a feasible state the measures descend along
the equations, accelerated (`measures`). A search over starts surrounds all this (`multistart`); a frame of
a drag makes a few steps (`method`).
"""
