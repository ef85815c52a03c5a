// Compiled with -mavx2, which the other files are not.
#define PROXCGAL_KERNELS kAvx2Kernels
#define PROXCGAL_KERNELS_NAME "avx2"
#include "kernels_body.hpp"
