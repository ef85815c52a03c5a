#pragma once
#include <cstdint>

#include "bvh.hpp"

namespace proxcgal::detail {

/// A link's box with its pose, in single precision: p_L - center = R_LW p_W - offset.
struct LinkBoxView {
  float R_LW[3][3];
  float offset[3];
  float half[3];
};

/// Neighbouring points side by side, one row a coordinate.
inline constexpr int kChunk = 64;
struct alignas(32) ChunkView {
  float p_W[3][kChunk];  // the last one repeated past the end
  int count;
};

/// What a search has found so far.
struct Nearest {
  double squared = kInfinity;
  double point[3] = {0, 0, 0};
  std::int32_t triangle = -1;
};

/// The innermost loops, compiled once for each instruction set that is worth it.
///
/// Only single operations on numbers differ, never their order, and none is contracted: every set
/// gives the same bits.
struct Kernels {
  const char* name;
  /// Improves `best`; ends early when `steps` falls below 0.
  void (*nearest)(const BvhView&, const double* point, Nearest& best, std::int64_t& steps);
  double (*squared_lower_bound)(const BvhView&, const double* point, int steps);
  bool (*within)(const BvhView&, const double* point, double squared_radius, std::int64_t& steps);
  /// Smallest t in [t_min, t_max) of a hit, or t_max.
  double (*first_hit)(const BvhView&, const double* origin, const double* direction, double t_min,
                      double t_max);
  /// Some t in [t_min, t_max) of a hit, or t_max.
  double (*any_hit)(const BvhView&, const double* origin, const double* direction, double t_min,
                    double t_max);
  /// Rows whose squared distance to the box, less the allowance, may be at most their limit.
  int (*near_rows)(const ChunkView&, const LinkBoxView&, float allowance, const float* limits,
                   std::uint8_t* rows);
  /// Lower bound of each row's squared distance to the box.
  void (*squared_bounds)(const ChunkView&, const LinkBoxView&, float allowance, float* out);
};

/// The best that this processor runs; PROXCGAL_KERNELS=portable in the environment forces the
/// portable ones. Chosen once, at the first call, which is the building of a tree.
/// @throws ConfigError  another name in the environment
const Kernels& kernels();

extern const Kernels kPortableKernels;
extern const Kernels kAvx2Kernels;

}  // namespace proxcgal::detail
