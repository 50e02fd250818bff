"""What the sea floor looks like: interpolation, uncertainty, products. Pure: numpy in, numpy out."""

import scipy.linalg  # noqa: F401 - its BLAS has to be loaded to be limited
from threadpoolctl import threadpool_limits

import app.compiled.index  # noqa: F401 - before anything compiled is imported

# The matrices here have a few hundred rows. Sharing one between threads gains nothing on an idle machine, costs twenty
# times as much on a busy one, and makes results depend on the number of cores.
threadpool_limits(limits=1, user_api="blas")
