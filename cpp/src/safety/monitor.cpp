#include "proxcgal/safety/monitor.hpp"

#include <algorithm>

#include "proxcgal/error.hpp"

namespace proxcgal {

void check(const MonitorConfig& config, const std::string& path) {
  require(config.joints_stop_after >= config.joints_hold_after, path + "joints_stop_after",
          detail::with_unit(config.joints_stop_after, "s"),
          "at least joints_hold_after = " + detail::with_unit(config.joints_hold_after, "s"));
}

Mode mode_of(Reason reason) {
  switch (reason) {
    case Reason::kJointStateInvalid:
    case Reason::kJointStateLost:
    case Reason::kJointStateUnits:
      return Mode::kStop;
    case Reason::kAllSensorsSilent:
    case Reason::kArraySilent:
    case Reason::kBlindMotion:
    case Reason::kJointStateStale:
    case Reason::kNotFollowing:
    case Reason::kHeldOff:
    case Reason::kNoControllableLink:
    case Reason::kGoalInvalid:
    case Reason::kDeadlinesMissed:
    case Reason::kMountsUnchecked:
      return Mode::kHold;
    case Reason::kSensorSilent:
    case Reason::kSensorSuspect:
    case Reason::kContact:
    case Reason::kPointsInvalid:
    case Reason::kWorkBounded:
      return Mode::kDegraded;
    case Reason::kScanRefused:
    case Reason::kZoneInvalid:
    case Reason::kTimeInvalid:
    case Reason::kLinkSkipped:
    case Reason::kRowSmall:
    case Reason::kNotExecuted:
    case Reason::kOutsideLimits:
    case Reason::kDeadlineMissed:
    case Reason::kAvoidanceStuck:
    case Reason::kPinched:
    case Reason::kLoopSlow:
    case Reason::kSingular:
      return Mode::kRun;  // reported; handled where it was found
  }
  return Mode::kStop;
}

bool brakes_only(Reason reason) {
  // With mounts unchecked no point is where it seems to be.
  return reason == Reason::kMountsUnchecked || reason == Reason::kJointStateStale ||
         reason == Reason::kDeadlinesMissed || reason == Reason::kNotFollowing ||
         mode_of(reason) == Mode::kStop;
}

const char* reason_name(Reason reason) {
  switch (reason) {
    case Reason::kSensorSilent:
      return "sensor_silent";
    case Reason::kAllSensorsSilent:
      return "all_sensors_silent";
    case Reason::kArraySilent:
      return "array_silent";
    case Reason::kSensorSuspect:
      return "sensor_suspect";
    case Reason::kBlindMotion:
      return "blind_motion";
    case Reason::kJointStateStale:
      return "joint_state_stale";
    case Reason::kJointStateLost:
      return "joint_state_lost";
    case Reason::kAvoidanceStuck:
      return "avoidance_stuck";
    case Reason::kContact:
      return "contact";
    case Reason::kScanRefused:
      return "scan_refused";
    case Reason::kZoneInvalid:
      return "zone_invalid";
    case Reason::kJointStateInvalid:
      return "joint_state_invalid";
    case Reason::kGoalInvalid:
      return "goal_invalid";
    case Reason::kTimeInvalid:
      return "time_invalid";
    case Reason::kNoControllableLink:
      return "no_controllable_link";
    case Reason::kLinkSkipped:
      return "link_skipped";
    case Reason::kRowSmall:
      return "row_small";
    case Reason::kNotExecuted:
      return "not_executed";
    case Reason::kOutsideLimits:
      return "outside_limits";
    case Reason::kDeadlineMissed:
      return "deadline_missed";
    case Reason::kDeadlinesMissed:
      return "deadlines_missed";
    case Reason::kWorkBounded:
      return "work_bounded";
    case Reason::kPointsInvalid:
      return "points_invalid";
    case Reason::kMountsUnchecked:
      return "mounts_unchecked";
    case Reason::kPinched:
      return "pinched";
    case Reason::kJointStateUnits:
      return "joint_state_units";
    case Reason::kNotFollowing:
      return "not_following";
    case Reason::kLoopSlow:
      return "loop_slow";
    case Reason::kHeldOff:
      return "held_off";
    case Reason::kSingular:
      return "singular";
  }
  return "unknown";
}

Monitor::Monitor(const MonitorConfig& config) : config_(config) { validate(config); }

void Monitor::begin() {
  count_ = 0;
  wanted_ = Mode::kRun;
  slows_ = brakes_ = false;
  if (held_off_) add({.reason = Reason::kHeldOff});
}

void Monitor::add(const Finding& finding) {
  const Mode calls_for = mode_of(finding.reason);
  wanted_ = std::max(wanted_, calls_for);
  // What a single sensor covered is slowed by direction instead: perception tells where.
  const bool local =
      finding.reason == Reason::kSensorSilent || finding.reason == Reason::kSensorSuspect;
  if (calls_for >= Mode::kDegraded && !local) slows_ = true;
  if (brakes_only(finding.reason)) brakes_ = true;
  // Past the room there is, the mode still counts the finding; only its details are lost.
  if (count_ < kMaxFindings) findings_[static_cast<std::size_t>(count_++)] = finding;
}

void Monitor::deadline(bool late) {
  late_ = late ? late_ + 1 : 0;
  if (!late) return;
  Finding finding;
  finding.reason =
      late_ >= config_.missed_deadlines ? Reason::kDeadlinesMissed : Reason::kDeadlineMissed;
  finding.count = late_;
  add(finding);
}

void Monitor::count_holds(double time) {
  for (const Finding& finding : findings()) {
    if (mode_of(finding.reason) != Mode::kHold || finding.reason == Reason::kHeldOff) continue;
    const auto end = begun_.begin() + n_begun_;
    // One HOLD may have the same finding of several sensors.
    if (std::any_of(begun_.begin(), end, [&](const Begun& each) {
          return each.reason == finding.reason && each.time == time;
        }))
      continue;
    if (n_begun_ == static_cast<int>(begun_.size())) {
      std::rotate(begun_.begin(), begun_.begin() + 1, begun_.end());
      --n_begun_;
    }
    begun_[static_cast<std::size_t>(n_begun_++)] = {finding.reason, time};
    const auto count =
        std::count_if(begun_.begin(), begun_.begin() + n_begun_, [&](const Begun& each) {
          return each.reason == finding.reason && time - each.time < config_.held_off_within;
        });
    if (count >= config_.held_off_count && config_.held_off_within > 0.0) held_off_ = true;
  }
}

Mode Monitor::conclude(double time) {
  slowed_for_ = slows_ ? config_.clean_cycles : std::max(slowed_for_ - 1, 0);
  if (mode_ == Mode::kStop) return mode_;
  if (wanted_ >= mode_) {
    clean_ = 0;
    clean_since_ = time;
  } else {
    ++clean_;
  }
  const bool clean = mode_ == Mode::kHold ? time - clean_since_ >= config_.hold_clear_after
                                          : clean_ >= config_.clean_cycles;
  if (wanted_ == Mode::kHold && mode_ < Mode::kHold) count_holds(time);
  if (wanted_ > mode_ || (wanted_ < mode_ && clean)) {
    mode_ = wanted_;
    clean_ = 0;
    clean_since_ = time;
  }
  return mode_;
}

bool Monitor::reset() {
  const bool stopped = mode_ == Mode::kStop;
  if (stopped && wanted_ == Mode::kStop) return false;
  if (!stopped && !held_off_) return false;
  held_off_ = false;
  n_begun_ = 0;
  mode_ = Mode::kHold;  // and on to RUN once it is clean
  clean_ = 0;
  return true;
}

}  // namespace proxcgal
