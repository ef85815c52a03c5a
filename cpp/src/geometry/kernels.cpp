#include "kernels.hpp"

#include <cstdlib>
#include <cstring>

namespace proxcgal::detail {
namespace {

const Kernels& choose() {
#ifdef PROXCGAL_HAS_AVX2
  const char* forced = std::getenv("PROXCGAL_KERNELS");
  const bool portable = forced != nullptr && std::strcmp(forced, "portable") == 0;
  if (!portable && __builtin_cpu_supports("avx2") != 0) return kAvx2Kernels;
#endif
  return kPortableKernels;
}

}  // namespace

const Kernels& kernels() {
  static const Kernels& chosen = choose();
  return chosen;
}

}  // namespace proxcgal::detail
