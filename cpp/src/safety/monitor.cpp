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
      return Mode::kStop;
    case Reason::kAllSensorsSilent:
    case Reason::kArraySilent:
    case Reason::kBlindMotion:
    case Reason::kJointStateStale:
    case Reason::kAvoidanceStuck:
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
      return Mode::kRun;  // told, and dealt with where it was found
  }
  return Mode::kStop;
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
  }
  return "unknown";
}

Monitor::Monitor(const MonitorConfig& config) : config_(config) { validate(config); }

void Monitor::begin() {
  count_ = 0;
  wanted_ = Mode::kRun;
  slows_ = false;
}

void Monitor::add(const Finding& finding) {
  const Mode calls_for = mode_of(finding.reason);
  wanted_ = std::max(wanted_, calls_for);
  // What a single sensor covered is slowed by direction instead: perception tells where.
  const bool local =
      finding.reason == Reason::kSensorSilent || finding.reason == Reason::kSensorSuspect;
  if (calls_for >= Mode::kDegraded && !local) slows_ = true;
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

Mode Monitor::conclude() {
  slowed_for_ = slows_ ? config_.clean_cycles : std::max(slowed_for_ - 1, 0);
  if (mode_ == Mode::kStop) return mode_;
  clean_ = wanted_ < mode_ ? clean_ + 1 : 0;
  if (wanted_ > mode_ || clean_ >= config_.clean_cycles) {
    mode_ = wanted_;
    clean_ = 0;
  }
  return mode_;
}

bool Monitor::reset() {
  if (mode_ != Mode::kStop || wanted_ == Mode::kStop) return false;
  mode_ = Mode::kHold;  // and on to RUN by clean cycles
  clean_ = 0;
  return true;
}

}  // namespace proxcgal
