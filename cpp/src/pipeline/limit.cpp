#include "proxcgal/pipeline/limit.hpp"

#include <algorithm>
#include <cmath>

#include "limit_levels.hpp"
#include "proxcgal/error.hpp"

namespace proxcgal {
namespace {

using detail::BoundRow;
using detail::Levels;
using detail::Programme;

constexpr double kRounding = 1e-12;       // [m/s] a row that is missed by less is fulfilled
constexpr double kKept = 5e-10;           // [m/s] violation of a cap that is left alone
constexpr double kFar = 1e6;              // rows and velocities beyond are no input
constexpr double kContradictory = 0.5;    // contradiction above which the nominal is reduced ...
constexpr double kBlocked = 0.8;          // ... and above which it is taken off
constexpr double kStandViolation = 0.02;  // [m/s] violation at which it is taken off
constexpr std::array kRelax{1e-11, 1e-9, 1e-7};  // [m/s]
constexpr double kLeavesWithin = 0.04;           // [m] beyond d_stop
constexpr double kPinched = 0.5;                 // of `stand`
constexpr double kStandFor = 1.0;                // [s] in which `stand` falls from 1 to 0

bool usable(const JointVector& v, Eigen::Index n) {
  return v.size() == n && v.allFinite() && (v.size() == 0 || v.cwiseAbs().maxCoeff() <= kFar);
}

/// Least and largest row qd over the interval.
double least(const JointVector& row, const JointInterval& interval) {
  return row.cwiseProduct(interval.low).cwiseMin(row.cwiseProduct(interval.high)).sum();
}
double largest(const JointVector& row, const JointInterval& interval) {
  return row.cwiseProduct(interval.low).cwiseMax(row.cwiseProduct(interval.high)).sum();
}

double ramp(double x, double from, double to) {
  return std::clamp((x - from) / (to - from), 0.0, 1.0);
}

}  // namespace

struct Limiter::Impl {
  Limits limits;
  LimitConfig config;
  PeriodBound bound;
  Levels levels;
  LimitState state;
  Programme programme;
  LimitOutput out;
  double nearest = kInfinity;  // [m] of the retreat rows
  double stand = 0.0;          // taken off the nominal for having been pinched a moment ago
  JointVector candidate, target, clamped;
  JointVector executed;  // velocity of an arm that follows with a lag of dead time + lag
  JointVector overrun;   // how far it still moves beyond what the last command says

  Impl(const Limits& l, const LimitConfig& c, double period)
      : limits(l),
        config(c),
        bound(period, c.period_margin),
        levels(static_cast<int>(l.qd_max.size())) {
    const auto n = limits.qd_max.size();
    out.qd = candidate = target = clamped = executed = overrun = JointVector::Zero(n);
    state.qd_brake = state.interval.low = state.interval.high = out.qd;
    programme.state = &state;
  }
  Impl(const Impl&) = delete;

  /// (0), the braking command and the times of (1).
  void reckon(const JointVector& q, const JointVector& qd_last, double elapsed,
              double joint_state_age) {
    bound.update(elapsed);
    const double D = bound.value();
    joint_interval(limits, q, qd_last, elapsed, D, state.interval);
    brake_together(limits, qd_last, std::min(elapsed, D), state.interval, state.qd_brake);
    // The command of this tick brakes to rest within the last one's time and the time passed: no
    // joint gains more than qdd_max elapsed.
    const double window = std::clamp(elapsed, 0.0, D);
    state.braking_time = (qd_last.cwiseAbs().array() / limits.qdd_max.array()).maxCoeff() + window;
    state.reaction = std::max(config.joint_state_age, joint_state_age) + D + config.dead_time +
                     config.lag + config.scan_latency;
    const double follows = config.dead_time + config.lag;
    const double share = follows > 0.0 ? -std::expm1(-window / follows) : 1.0;
    executed += share * (qd_last - executed);
    overrun = follows * (executed - qd_last);
    stand = std::max(0.0, stand - window / kStandFor);
  }

  double cap_least(const ApproachCap& cap) const {
    // c (dead time + lag) is in (1) for an arm that moves as commanded. One that still moves faster
    // closes the distance by more.
    ApproachCap nearer = cap;
    nearer.distance -= std::max(0.0, -cap.row.dot(overrun));
    const double c =
        std::max(0.0, approach_speed(config, nearer, state.reaction, state.braking_time));
    // (1) row qd >= min(-c, row qd_brake): the braking command fulfils it, whatever the row is.
    return std::min(-c, cap.row.dot(state.qd_brake));
  }

  bool read(const LimitInput& in) {
    const auto n = limits.qd_max.size();
    if (!usable(in.nominal, n)) return false;
    programme.n_caps = programme.n_retreats = 0;
    for (const ApproachCap& cap : in.caps) {
      if (!usable(cap.row, n) || std::isnan(cap.distance) || std::isnan(cap.speed)) return false;
      if (programme.n_caps == kMaxCaps) continue;  // `keep_caps` sees to it
      BoundRow& row = programme.caps[static_cast<std::size_t>(programme.n_caps)];
      row = {.row = &cap.row, .least = cap_least(cap)};
      row.binds = least(cap.row, state.interval) < row.least;
      if (row.binds) ++programme.n_caps;
    }
    nearest = kInfinity;
    for (const RetreatRow& retreat : in.retreats) {
      nearest = std::min(nearest, retreat.distance);
      if (programme.n_retreats == kMaxRetreats) break;
      const double rate = retreat_rate(config, retreat);
      if (!usable(retreat.row, n) || std::isnan(rate) || rate > kFar) return false;
      const auto k = static_cast<std::size_t>(programme.n_retreats++);
      BoundRow& row = programme.retreats[k];
      row = {.row = &retreat.row, .least = rate};
      row.binds = least(retreat.row, state.interval) < rate;
      programme.weight[k] = retreat_weight(retreat);
      // Beyond d_stop a row leaves (2a) by and by: no row enters or leaves in a step.
      programme.allowance[k] = std::max(0.0, rate) *
                               ramp(retreat.distance, config.d_stop, config.d_stop + kLeavesWithin);
    }
    return true;
  }

  bool admissible(const LimitInput& in) const {
    const JointVector& qd = in.nominal;
    if ((qd.array() < state.interval.low.array()).any() ||
        (qd.array() > state.interval.high.array()).any())
      return false;
    const auto fulfilled = [&](const BoundRow& row) {
      return !row.binds || row.row->dot(qd) >= row.least - kRounding;
    };
    return std::all_of(in.caps.begin(), in.caps.end(),
                       [&](const ApproachCap& cap) {
                         return cap.row.dot(qd) >= cap_least(cap) - kRounding;
                       }) &&
           std::all_of(programme.retreats.begin(),
                       programme.retreats.begin() + programme.n_retreats, fulfilled);
  }

  /// From the braking command towards `qd`, as far as every cap allows: what the solver's rounding
  /// left, and the caps beyond kMaxCaps.
  void keep_caps(const LimitInput& in, JointVector& qd) const {
    double s = 1.0;
    for (const ApproachCap& cap : in.caps) {
      const double bound = cap_least(cap);
      const double rate = cap.row.dot(qd);
      if (rate >= bound - kKept) continue;
      const double braking = cap.row.dot(state.qd_brake);
      s = std::min(s, std::max(0.0, braking - bound) / (braking - rate));
    }
    if (s >= 1.0) return;
    qd = state.qd_brake + s * (qd - state.qd_brake);
    qd = qd.cwiseMax(state.interval.low).cwiseMin(state.interval.high);
  }

  /// Could every retreat row have its rate, each for itself?
  bool attainable() const {
    for (int i = 0; i < programme.n_retreats; ++i) {
      const BoundRow& row = programme.retreats[static_cast<std::size_t>(i)];
      if (largest(*row.row, state.interval) < row.least) return false;
    }
    return true;
  }

  void solve(const LimitInput& in) {
    out.status = LimitStatus::kLimited;
    levels.weigh(in.tasks, config);
    std::array<double, kMaxRetreats> rates;
    const auto n_rows = static_cast<std::size_t>(programme.n_retreats);
    for (std::size_t k = 0; k < n_rows; ++k) rates[k] = programme.retreats[k].least;
    target = (1.0 - stand) * in.nominal;
    out.stand = stand;
    // (3) with every retreat row fulfilled: then (2a) and (2b) have nothing left to do.
    if (attainable() && levels.nearest(programme, target, rates, candidate)) {
      keep_caps(in, candidate);
      out.qd = candidate;
      return;
    }
    out.qd = state.qd_brake;
    out.status = LimitStatus::kBraking;
    if (n_rows == 0) return;
    // (2a)
    clamped =
        ((1.0 - stand) * in.nominal).cwiseMax(state.interval.low).cwiseMin(state.interval.high);
    // Nearer than d_stop every bit of distance counts.
    levels.calm(stand * ramp(nearest, config.d_stop, config.d_stop + kLeavesWithin));
    if (!levels.least_violation(programme, clamped, candidate)) return;
    out.qd = candidate;
    keep_caps(in, out.qd);
    out.status = LimitStatus::kPartly;
    double t = 0.0;
    for (std::size_t k = 0; k < n_rows; ++k) {
      const BoundRow& row = programme.retreats[k];
      if (row.binds) t = std::max(t, row.least - programme.allowance[k] - row.row->dot(candidate));
    }
    out.violation = t;
    // (2b)
    if (!levels.least_squares(programme, clamped, t, candidate)) return;
    out.contradiction = levels.contradiction(programme, candidate);
    out.qd = candidate;
    keep_caps(in, out.qd);
    double worst = 0.0;
    for (std::size_t k = 0; k < n_rows; ++k) {
      const double rate = programme.retreats[k].row->dot(candidate);
      worst = std::max(worst, programme.retreats[k].least - rate);
      rates[k] = std::min(rates[k], rate);
    }
    // It falls slowly: an arm that stands is not pinched for long by its own nominal motion.
    out.stand = std::max(stand, ramp(out.contradiction, kContradictory, kBlocked) *
                                    ramp(worst, 0.0, kStandViolation));
    stand = out.stand;
    out.pinched = out.stand > kPinched;
    // (3)
    target = (1.0 - out.stand) * in.nominal;
    // The rates that (2b) leaves hold all but with equality: they give way by its rounding.
    for (const double relax : kRelax) {
      std::array<double, kMaxRetreats> relaxed = rates;
      for (std::size_t k = 0; k < n_rows; ++k) relaxed[k] -= relax;
      if (!levels.nearest(programme, target, relaxed, candidate)) continue;
      keep_caps(in, candidate);
      out.qd = candidate;
      out.status = LimitStatus::kLimited;
      return;
    }
  }

  void begin() {
    out.n_active = out.n_retreats = out.programmes = out.iterations = 0;
    out.contradiction = out.stand = out.violation = 0.0;
    out.pinched = false;
    out.status = LimitStatus::kBraking;
    levels.iterations = levels.solved = 0;
  }

  void note(LimitKind kind, int link, double distance, double rate) {
    if (out.n_active < static_cast<int>(out.active.size()))
      out.active[static_cast<std::size_t>(out.n_active++)] = {kind, link, distance, rate};
  }

  /// The rows that (3) holds with equality, by their multipliers.
  void report(const LimitInput& in) {
    out.programmes = levels.solved;
    out.iterations = levels.iterations;
    out.n_retreats = programme.n_retreats;
    for (int i = 0; i < programme.n_retreats; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const double rate = programme.retreats[k].least;
      out.share[k] = rate > kRounding
                         ? std::clamp(programme.retreats[k].row->dot(out.qd) / rate, 0.0, 1.0)
                         : 1.0;
    }
    if (out.status != LimitStatus::kLimited) return;
    const auto& solver = levels.joints();
    for (int j = 0; j < static_cast<int>(limits.qd_max.size()); ++j) {
      if (solver.holds(levels.joint_row(j, false)) || solver.holds(levels.joint_row(j, true)))
        note(LimitKind::kJoint, j, kInfinity, out.qd[j]);
    }
    for (int i = 0; i < programme.n_caps; ++i) {
      const BoundRow& row = programme.caps[static_cast<std::size_t>(i)];
      if (!solver.holds(row.at)) continue;
      const ApproachCap* cap = &in.caps.front();
      while (&cap->row != row.row) ++cap;
      note(cap->kind, cap->link, cap->distance, row.row->dot(out.qd));
    }
    for (int i = 0; i < programme.n_retreats; ++i) {
      const BoundRow& row = programme.retreats[static_cast<std::size_t>(i)];
      const RetreatRow& retreat = in.retreats[static_cast<std::size_t>(i)];
      if (solver.holds(row.at))
        note(retreat.kind, retreat.link, retreat.distance, row.row->dot(out.qd));
    }
  }
};

Limiter::Limiter(const Limits& limits, const LimitConfig& config, double period) {
  validate(config);
  const auto n = limits.qd_max.size();
  require(
      n > 0 && limits.q_min.size() == n && limits.q_max.size() == n && limits.qdd_max.size() == n,
      "joints of the limits", n, "above 0 and the same in all four");
  require(limits.qd_max.allFinite() && (limits.qd_max.array() >= 0.0).all(), "qd_max",
          limits.qd_max.transpose(), "finite and at least 0");
  require(limits.qdd_max.allFinite() && (limits.qdd_max.array() > 0.0).all(), "qdd_max",
          limits.qdd_max.transpose(), "finite and above 0");
  require(period > 0.0 && period <= 1.0, "period", period, "above 0 and at most 1 s");
  impl_ = std::make_unique<Impl>(limits, config, period);
}
Limiter::~Limiter() = default;
Limiter::Limiter(Limiter&&) noexcept = default;
Limiter& Limiter::operator=(Limiter&&) noexcept = default;

const LimitState& Limiter::begin(const JointVector& q, const JointVector& qd_last, double elapsed,
                                 double joint_state_age) {
  Impl& me = *impl_;
  const auto n = me.limits.qd_max.size();
  me.begin();
  me.state.usable = q.size() == n && q.allFinite() && usable(qd_last, n) &&
                    std::isfinite(elapsed) && std::isfinite(joint_state_age);
  // Where nothing is known there is nothing that a braking command could start from.
  me.out.qd.setZero();
  if (!me.state.usable) return me.state;
  me.reckon(q, qd_last, elapsed, joint_state_age);
  me.out.qd = me.state.qd_brake;
  return me.state;
}

const LimitOutput& Limiter::limit(const LimitInput& in) {
  Impl& me = *impl_;
  if (!me.state.usable || !me.read(in)) return me.out;
  if (me.stand == 0.0 && me.admissible(in)) {
    me.out.qd = in.nominal;
    me.out.status = LimitStatus::kUnchanged;
  } else {
    me.solve(in);
  }
  me.report(in);
  return me.out;
}

const LimitOutput& Limiter::brake() {
  Impl& me = *impl_;
  me.begin();
  if (me.state.usable) me.out.qd = me.state.qd_brake;
  return me.out;
}
const LimitState& Limiter::state() const { return impl_->state; }

const LimitConfig& Limiter::config() const { return impl_->config; }
double Limiter::max_period() const { return impl_->bound.value(); }

}  // namespace proxcgal
