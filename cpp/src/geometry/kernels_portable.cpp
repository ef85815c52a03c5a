#define PROXCGAL_KERNELS kPortableKernels
#define PROXCGAL_KERNELS_NAME "portable"
#include "kernels_body.hpp"
