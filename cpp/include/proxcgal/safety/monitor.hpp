#pragma once
#include <array>

#include "proxcgal/types.hpp"

namespace proxcgal {

/// Freshness bounds; the rest of the table is fixed (docs/conventions.md).
struct MonitorConfig {
  double degraded_after = 0.14;  ///< [s] age at which one silent sensor degrades the mode
  double hold_after = 0.19;      ///< [s] age at which the silence of an array holds the arm
  double degraded_scale = 0.5;   ///< [-] of the speed limits while degraded
  int clean_cycles = 10;         ///< cycles without a cause before HOLD or DEGRADED clears
  int missed_deadlines = 3;      ///< in a row, before HOLD
  int suspect_repeats = 5;      ///< equal payloads in a row that make a sensor suspect, 0 for never
  double fresh_within = 0.10;   ///< [s] a scan of this age is trusted as it is
  double approach_speed = 1.6;  ///< [m/s] assumed of what moves in: past `fresh_within` it
                                ///< shortens the distance that is trusted
  double blind_speed = 0.25;    ///< [m/s] at most into what a silent sensor covered, 0 in the end
  double joints_hold_after = 0.02;  ///< [s] age of the joint state that holds the arm
  double joints_stop_after = 0.10;  ///< [s] age of the joint state that stops it
  double stuck_after = 0.1;         ///< [s] of avoidance not executed inside d_min, before HOLD
  bool await_mounts = false;        ///< HOLD until `Controller::accept_mounts`
  void validate() const;
};

inline constexpr int kMaxFindings = 64;
inline constexpr double kClockResolution = 1e-3;  ///< [s] a stamp may be that far in the future

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
  /// Did anything but a single sensor call for less than RUN, in the last clean cycles?
  bool slowed() const { return slowed_for_ > 0; }
  std::span<const Finding> findings() const {
    return {findings_.data(), static_cast<std::size_t>(count_)};
  }

 private:
  MonitorConfig config_;
  std::array<Finding, kMaxFindings> findings_{};
  int count_ = 0;
  int clean_ = 0;
  int late_ = 0;
  int slowed_for_ = 0;
  bool slows_ = false;
  Mode wanted_ = Mode::kRun;
  Mode mode_ = Mode::kRun;
};

}  // namespace proxcgal
