#include "kernels.hpp"

#include <cstdlib>
#include <string>

#include "proxcgal/error.hpp"

namespace proxcgal::detail {
namespace {

const Kernels& choose() {
  const char* set = std::getenv("PROXCGAL_KERNELS");
  const std::string wanted = set != nullptr ? set : "";
  if (!wanted.empty() && wanted != "portable")
    throw ConfigError("PROXCGAL_KERNELS is '" + wanted + "', must be 'portable' or not set");
#ifdef PROXCGAL_HAS_AVX2
  if (wanted.empty() && __builtin_cpu_supports("avx2") != 0) return kAvx2Kernels;
#endif
  return kPortableKernels;
}

}  // namespace

const Kernels& kernels() {
  static const Kernels& chosen = choose();
  return chosen;
}

}  // namespace proxcgal::detail
