"""
Accuracy and speed of the detector, side by side with its peers and with the published method.

Not installed; ``script/benchmark`` runs it.  Numerical libraries are kept to one thread each, so
that times of different detectors can be compared; that has to be said before they are loaded.
"""
import os

for _name in ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS', 'NUMBA_NUM_THREADS',
              'RAYON_NUM_THREADS'):
    os.environ[_name] = '1'
