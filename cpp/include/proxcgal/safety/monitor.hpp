#pragma once
#include <algorithm>
#include <array>

#include "proxcgal/fields.hpp"
#include "proxcgal/types.hpp"

namespace proxcgal {

/// Bounds of the monitor; which finding calls for which mode is fixed (docs/conventions.md).
struct MonitorConfig {
  double degraded_after = 0.14;
  double hold_after = 0.19;
  double degraded_scale = 0.5;
  int clean_cycles = 10;
  double hold_clear_after = 0.5;
  double ramp = 1.0;
  int held_off_count = 3;
  double held_off_within = 10.0;
  double following_tolerance = 0.3;
  int missed_deadlines = 3;
  int suspect_repeats = 5;
  double fresh_within = 0.10;
  double approach_speed = 1.6;
  double blind_speed = 0.25;
  double joints_hold_after = 0.02;
  double joints_stop_after = 0.10;
  double stuck_after = 0.1;
  bool await_mounts = false;
};

template <>
inline constexpr auto fields<MonitorConfig> = field_table(
    "MonitorConfig", "Bounds of the monitor.",
    field(&MonitorConfig::degraded_after, "degraded_after", "s", above(0).or_infinite(),
          "Age of one sensor's scan that degrades the mode."),
    field(&MonitorConfig::hold_after, "hold_after", "s", above(0).or_infinite(),
          "Age of an array's scans that holds the arm."),
    field(&MonitorConfig::degraded_scale, "degraded_scale", "", between(0, 1),
          "Factor on the nominal motion while degraded; retreat keeps its rate."),
    field(&MonitorConfig::clean_cycles, "clean_cycles", "", at_least(1),
          "Cycles without a cause before DEGRADED clears."),
    field(&MonitorConfig::hold_clear_after, "hold_clear_after", "s", at_least(0),
          "Time without a cause before HOLD clears."),
    field(&MonitorConfig::ramp, "ramp", "s", above(0),
          "Time in which the nominal motion comes back from rest to its full speed."),
    field(
        &MonitorConfig::held_off_count, "held_off_count", "", at_least(1),
        "HOLDs of one cause within `held_off_within` that hold the arm until `Controller.reset`."),
    field(&MonitorConfig::held_off_within, "held_off_within", "s", at_least(0).or_infinite(),
          "Time in which HOLDs of one cause are counted; 0: never held off."),
    field(&MonitorConfig::following_tolerance, "following_tolerance", "", above(0).or_infinite(),
          "Share of a joint's commanded velocity by which its motion may differ before the arm "
          "counts "
          "as not following; inf: never."),
    field(&MonitorConfig::missed_deadlines, "missed_deadlines", "", at_least(1),
          "Missed deadlines in a row that hold the arm."),
    field(&MonitorConfig::suspect_repeats, "suspect_repeats", "", at_least(0),
          "Equal payloads in a row that make a sensor suspect; 0: never (sensors without noise)."),
    field(&MonitorConfig::fresh_within, "fresh_within", "s", above(0).or_infinite(),
          "Distances of a scan up to this age are trusted as measured."),
    field(&MonitorConfig::approach_speed, "approach_speed", "m/s", at_least(0).or_infinite(),
          "Assumed speed of an obstacle since its scan: shortens the trusted distance past "
          "`fresh_within`."),
    field(&MonitorConfig::blind_speed, "blind_speed", "m/s", at_least(0).or_infinite(),
          "Maximum speed into the region that a silent sensor covered; falls to 0 at "
          "`hold_after`."),
    field(&MonitorConfig::joints_hold_after, "joints_hold_after", "s", above(0).or_infinite(),
          "Age of the joint state that holds the arm."),
    field(&MonitorConfig::joints_stop_after, "joints_stop_after", "s", above(0).or_infinite(),
          "Age of the joint state that stops the arm."),
    field(&MonitorConfig::stuck_after, "stuck_after", "s", above(0).or_infinite(),
          "Time with avoidance not executed inside d_min before it is reported as stuck."),
    field(&MonitorConfig::await_mounts, "await_mounts",
          "Hold the arm until `Controller.accept_mounts` confirms the checked mounts."));
void check(const MonitorConfig& config, const std::string& path);

inline constexpr int kMaxFindings = 64;
inline constexpr double kClockResolution = 1e-3;  ///< [s] a stamp may be that far in the future

/// The mode a finding calls for. One table for all.
Mode mode_of(Reason reason);
/// Does a finding leave nothing but braking: is where the arm is, or what it does, unknown?
bool brakes_only(Reason reason);
const char* reason_name(Reason reason);

/// Collects the findings of a tick and derives the mode. STOP is latched until `reset`.
class Monitor {
 public:
  explicit Monitor(const MonitorConfig& config);

  void begin();  ///< forget the last tick's findings
  void add(const Finding& finding);
  void deadline(bool late);
  /// The mode that the findings so far lead to.
  Mode expected() const { return mode_ == Mode::kStop ? mode_ : std::max(mode_, wanted_); }
  /// Mode after this tick's findings: DEGRADED is held for `clean_cycles`, HOLD for
  /// `hold_clear_after`. @param time  [s] of the controller's own clock
  Mode conclude(double time);
  /// Leaves STOP and what held the arm off; effective only when the last tick had no cause for
  /// STOP.
  bool reset();

  Mode mode() const { return mode_; }
  /// Does a finding of this tick, or STOP, leave nothing but braking?
  bool brakes() const { return brakes_ || mode_ == Mode::kStop; }
  /// `mode`, but RUN where a single sensor alone degrades it: its view is slowed by direction.
  Mode slowed(Mode mode) const {
    return mode == Mode::kDegraded && slowed_for_ == 0 && !slows_ ? Mode::kRun : mode;
  }
  std::span<const Finding> findings() const {
    return {findings_.data(), static_cast<std::size_t>(count_)};
  }

 private:
  void count_holds(double time);

  MonitorConfig config_;
  std::array<Finding, kMaxFindings> findings_{};
  int count_ = 0;
  int clean_ = 0;
  int late_ = 0;
  int slowed_for_ = 0;
  bool slows_ = false;
  bool brakes_ = false;
  bool held_off_ = false;
  double clean_since_ = 0.0;  // [s]
  /// [s] the last HOLDs of each reason began, the newest first.
  struct Begun {
    Reason reason = Reason::kHeldOff;
    double time = 0.0;
  };
  std::array<Begun, 64> begun_{};
  int n_begun_ = 0;
  Mode wanted_ = Mode::kRun;
  Mode mode_ = Mode::kRun;
};

}  // namespace proxcgal
