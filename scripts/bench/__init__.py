"""Speed beside error: what gearstab takes against other ways to the same numbers, side by side in one run.

``make bench`` runs the tables of methods, ``make bench-scale`` those of whole sweeps; both are ``python -m bench``
with names and the folder of the scripts on the path. Ways take turns, and processor time counts, so that other work on
the machine shows less; GEARSTAB_SIMD limits the vector instructions.
"""

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    # One core for everybody, read when NumPy is imported; idle threads of OpenBLAS spin for a while and would count.
    os.environ[variable] = "1"
os.environ.setdefault("GEARSTAB_THREADS", "1")
os.environ["PYTHONDONTWRITEBYTECODE"] = ""  # whole commands run with stored byte code, as users have it
