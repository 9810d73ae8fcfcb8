"""
Accuracy and speed of the detector, side by side with its peers and with the published method.

The benchmark is not installed; ``script/benchmark`` runs it.  The environment limits numerical
libraries to one thread, before they are loaded, so that the times of detectors can be compared.
"""
import os

for _name in ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS', 'NUMBA_NUM_THREADS',
              'RAYON_NUM_THREADS'):
    os.environ[_name] = '1'
