#pragma once
#include <array>

#include "proxcgal/types.hpp"

namespace proxcgal {

/// Freshness bounds; the rest of the table is fixed (docs/conventions.md).
struct MonitorConfig {
  double degraded_after = 0.14;  ///< [s] age at which one silent sensor degrades the mode
  double hold_after = 0.19;      ///< [s] age at which the silence of all sensors holds the arm
  double degraded_scale = 0.5;   ///< [-] of the speed limits while degraded
  int clean_cycles = 10;         ///< cycles without a cause before HOLD or DEGRADED clears
  int missed_deadlines = 3;      ///< in a row, before HOLD
  void validate() const;
};

inline constexpr int kMaxFindings = 64;

/// The mode a finding calls for. One table for all.
Mode mode_of(Reason reason);
const char* reason_name(Reason reason);

/// Collects the findings of a tick and derives the mode. STOP is latched until `reset`.
class Monitor {
 public:
  explicit Monitor(const MonitorConfig& config);

  void begin();  ///< forget the last tick's findings
  void add(const Finding& finding);
  void deadline(bool late);
  /// Mode after this tick's findings, with HOLD and DEGRADED held for `clean_cycles`.
  Mode conclude();
  /// Leaves STOP; effective only when the last tick had no cause for it.
  bool reset();

  Mode mode() const { return mode_; }
  std::span<const Finding> findings() const {
    return {findings_.data(), static_cast<std::size_t>(count_)};
  }

 private:
  MonitorConfig config_;
  std::array<Finding, kMaxFindings> findings_{};
  int count_ = 0;
  int clean_ = 0;
  int late_ = 0;
  Mode wanted_ = Mode::kRun;
  Mode mode_ = Mode::kRun;
};

}  // namespace proxcgal
