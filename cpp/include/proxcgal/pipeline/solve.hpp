#pragma once
#include <array>
#include <span>

#include "proxcgal/fields.hpp"
#include "proxcgal/types.hpp"

namespace proxcgal {

enum class Damping : std::uint8_t {
  kLiteral,  ///< thesis eq. (4.7): 1 / (s + p(s))
  kCode,     ///< the authors' published code: s / (s^2 + p(s))
};

template <>
inline constexpr auto choices<Damping> =
    std::array{Choice{"literal", Damping::kLiteral}, Choice{"code", Damping::kCode}};

/// Constants of the regularised pseudo-inverse, [iCAT].
struct SolverConfig {
  double damping = 1e-4;
  double damping_threshold = 0.01;
  double eta = 10.0;
  Damping form = Damping::kLiteral;
};

template <>
inline constexpr auto fields<SolverConfig> = field_table(
    "SolverConfig", "Constants of the regularised pseudo-inverse. Source: thesis eq. (4.7).",
    field(&SolverConfig::damping, "damping", "", at_least(0),
          "lambda: the most that is added to an eigenvalue."),
    field(&SolverConfig::damping_threshold, "damping_threshold", "", above(0),
          "s_th: eigenvalues of X'AX below it are damped, singular values below its square root."),
    field(&SolverConfig::eta, "eta", "", at_least(0),
          "Cost of leaving the freedom that upper levels left."),
    field(&SolverConfig::form, "form",
          "Damped inverse of s: 1 / (s + p) as eq. (4.7), or s / (s^2 + p) as its authors' code."));

/// The joint velocities after each level; the last is the answer.
struct Solution {
  int levels = 0;                               ///< tasks, the closing level not counted
  std::array<JointVector, kMaxLevels + 1> rho;  ///< rho[k]: after task k; rho[levels]: closed
  /// Levels left out because a number in them overflowed: a Jacobian or rate beyond about 1e150.
  int overflowed = 0;

  const JointVector& qd() const { return rho[levels]; }
};

/// The iCAT task-priority solver ([iCAT], thesis eqs. 4.7 and 4.8), with the slips of the texts
/// mended (docs/sources.md). Level 0 comes first; a closing level (J = A = I, rate 0) is appended.
///
/// Each level's term is scaled, direction kept, so that the sum so far stays within `qd_max`; a
/// joint that already stands at its limit stops every further term that would push it on.
/// Rank-deficient, conflicting and badly scaled levels give a finite answer: the damping bounds
/// it. For finite input no velocity is NaN: a level that overflows is left out and counted.
/// Allocates nothing.
/// @param tasks   at most kMaxLevels, each (m, n) with m <= kMaxRows, activation in [0, 1]
/// @param n       joints, at most kMaxJoints
/// @param qd_max  (n,) not negative, or empty for no saturation
void solve(std::span<const Task> tasks, int n, const JointVector& qd_max,
           const SolverConfig& config, Solution& out);

/// rate - J qd of one task, row by row.
RowVector residual(const Task& task, const JointVector& qd);

}  // namespace proxcgal
