#pragma once
#include <cmath>
#include <cstdint>

namespace proxcgal::detail {

// Several numbers at a time, whatever the processor offers: the compiler maps them.
using Float4 = float __attribute__((vector_size(16)));
using Float8 = float __attribute__((vector_size(32)));
using Double4 = double __attribute__((vector_size(32)));
using Mask4 = std::int64_t __attribute__((vector_size(32)));

inline constexpr int kWide = 4;

/// Single precision that is not below a squared bound. Static: a copy for each instruction set.
static inline float not_below(double squared) {
  const auto rounded = static_cast<float>(squared);
  return static_cast<double>(rounded) < squared ? rounded * 1.0000002F : rounded;
}

}  // namespace proxcgal::detail
