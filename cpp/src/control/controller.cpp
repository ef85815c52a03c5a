#include "proxcgal/control/controller.hpp"

#include <Eigen/SVD>
#include <cmath>

#include "arm_following.hpp"
#include "avoidance_execution.hpp"
#include "control_points.hpp"
#include "distance_rows.hpp"
#include "loop_rate.hpp"
#include "nominal_speed.hpp"
#include "obstacle_velocities.hpp"
#include "perception/monotonic_clock.hpp"
#include "perception/perception.hpp"
#include "perception/stopwatch.hpp"
#include "proxcgal/error.hpp"
#include "task_stack.hpp"
#include "tick_history.hpp"
#include "trusted_distance.hpp"

namespace proxcgal {
namespace {

constexpr double kRigid = 1e-3;          // how far a goal's rotation may be from orthonormal
constexpr double kSpeedRounding = 1e-9;  // [rad/s] or [m/s]
constexpr double kFarOutside = 1.0;      // [rad] or [m]

bool is_rigid(const Pose& T) {
  return T.matrix().allFinite() &&
         (T.linear() * T.linear().transpose() - Eigen::Matrix3d::Identity()).norm() < kRigid &&
         T.linear().determinant() > 0.0;
}

/// The nearest rigid pose: numbers rounded to four decimals leave a rotation that is none.
Pose orthonormal(const Pose& T) {
  constexpr double exact = 1e-12;
  if ((T.linear() * T.linear().transpose() - Eigen::Matrix3d::Identity()).norm() < exact) return T;
  Pose out = T;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(T.linear(),
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  out.linear() = svd.matrixU() * svd.matrixV().transpose();
  return out;
}

const Limits& with_limits(const Robot& robot, const Limits& limits) {
  if (limits.qd_max.allFinite() && limits.qdd_max.allFinite()) return limits;
  throw ConfigError("robot '" + robot.spec().name +
                    "' has a joint without a speed or acceleration limit: give both");
}

}  // namespace

struct Controller::Impl {
  std::shared_ptr<const Robot> robot;
  Skin skin;
  ControllerConfig config;
  Monitor monitor;
  detail::Perception perception;
  detail::ControlPoints control_points;
  detail::TaskStack stack;
  detail::TrustedDistance trusted;
  detail::DistanceRows rows;
  detail::AvoidanceExecution execution;
  detail::ArmFollowing following;
  detail::NominalSpeed nominal_speed;
  detail::LoopRate loop_rate;
  Limits limits;
  Limiter limiter;
  detail::MonotonicClock clock;

  detail::TickHistory history;
  bool mounts_accepted;

  JointVector qd_last;
  Posture posture;
  const Points none_W = Points(0, 3);
  Points estimate_W = Points::Zero(1, 3);  // velocity of the closest obstacle [m/s]
  const PointsRef estimate_ref_W = estimate_W;
  Solution solution;
  TickOutput out;

  Impl(std::shared_ptr<const Robot> r, Skin s, ControllerConfig c)
      : robot(std::move(r)),
        skin(std::move(s)),
        config(std::move(c)),
        monitor(config.monitor),
        perception(robot, skin,
                   {.filter = config.filter,
                    .monitor = config.monitor,
                    .method = config.method,
                    .memory = config.memory,
                    .motion = config.motion,
                    .timings = config.timings}),
        control_points(*robot, skin, config),
        stack(*robot, skin, config),
        trusted(*robot, config),
        rows(*robot, skin, config),
        execution(config),
        following(config.limit, config.period, config.monitor.following_tolerance),
        nominal_speed(config.monitor.degraded_scale, config.monitor.ramp),
        loop_rate(config.period),
        limits{robot->q_min(), robot->q_max(), robot->qd_max(), robot->qdd_max()},
        limiter(with_limits(*robot, limits), config.limit, config.period),
        clock(config.period),
        mounts_accepted(!config.monitor.await_mounts),
        posture(robot->make_posture()) {
    qd_last = JointVector::Zero(robot->n_q());
    out.qd = out.nominal_qd = qd_last;
    out.n_tasks = static_cast<int>(config.tasks.size());
  }

  void note(Reason reason, int link = -1) { monitor.add({.reason = reason, .link = link}); }

  /// An age that is not a number, or below nothing, says that the stamp is of another clock.
  void judge_age(double age) {
    const bool known = age >= -kClockResolution;  // so that what is not a number is unknown
    if (known && age <= config.monitor.joints_hold_after) return;
    const bool lost = known && age > config.monitor.joints_stop_after;
    monitor.add({.reason = lost ? Reason::kJointStateLost : Reason::kJointStateStale, .age = age});
  }

  /// The joint state can be used; else the reason is noted.
  bool joints_usable(double time, const JointVector& q, std::optional<double> q_stamp) {
    const bool good = q.size() == robot->n_q() && q.allFinite();
    if (!good) note(Reason::kJointStateInvalid);
    if (q_stamp) judge_age(time - *q_stamp);
    if (!good) return false;
    const int joint = far_outside(q);
    if (joint >= 0) note(Reason::kJointStateUnits, joint);
    const int stray = following.judge(clock.now(), q);
    if (stray >= 0) note(Reason::kNotFollowing, stray);
    return joint < 0;
  }

  /// A joint that is over a radian or a metre outside its limits: no arm goes there, but degrees
  /// do.
  int far_outside(const JointVector& q) const {
    for (Eigen::Index j = 0; j < q.size(); ++j) {
      if (q[j] < limits.q_min[j] - kFarOutside || q[j] > limits.q_max[j] + kFarOutside)
        return static_cast<int>(j);
    }
    return -1;
  }

  /// The goal, or where the tool is: with a goal that cannot be used it goes nowhere.
  Pose usable_goal(const Pose& goal) {
    if (is_rigid(goal)) return orthonormal(goal);
    note(Reason::kGoalInvalid);
    return posture.T_WT;
  }

  /// The nearest pair ([WA] Algorithm 2), and how far its distance is to be trusted.
  void find_nearest(const PointsRef& cloud_W, bool sensed) {
    out.pair = control_points.nearest(clock.now(), *robot, posture, cloud_W, trusted.d_min(),
                                      stack.engaged_within(), monitor);
    if (sensed) {
      trusted.of_sensed(clock.now(), posture, perception, control_points, out, monitor);
    } else {
      trusted.of_known(posture, out);
    }
  }

  /// How obstacles move: as given or, of sensed points, as estimated round the pair's obstacle.
  detail::ObstacleVelocities velocities_of(const PointsRef& cloud_W, bool sensed,
                                           const detail::ObstacleVelocities& given) {
    if (!out.pair) return given;
    const Vector3& obstacle_W = out.pair->obstacle_W;
    out.obstacle_velocity_W = given.of(out.pair->point);
    if (!sensed || !config.motion) return given;
    out.obstacle_velocity_W = perception.velocity_W(clock.now(), obstacle_W);
    estimate_W.row(0) = out.obstacle_velocity_W.transpose();
    return {estimate_ref_W, cloud_W, obstacle_W, config.motion->radius};
  }

  /// The nearest pair of each link, as far as something could limit the link's motion.
  void find_each(const PointsRef& cloud_W, const detail::ObstacleVelocities& velocities) {
    rows.begin();
    if (config.limit.distances)
      rows.reach(limiter.state(), qd_last, clock.elapsed(), posture, velocities.fastest());
    rows.reach_at_least(stack.links_within(out));
    control_points.search_each(*robot, posture, cloud_W, rows.within(), monitor);
  }

  /// Every distance that limits this tick's velocity.
  void gather(const detail::DistanceScene& scene) {
    if (config.limit.distances) {
      rows.add_links(scene, control_points);
      if (out.pair) {
        rows.keep_nearest(posture, trusted.control(out, Vector3::Zero()), out.trusted_distance,
                          limiter.state());
      }
      if (config.control_point == ControlPoint::kSensor && out.control.link >= 0)
        rows.add_sensor_point(posture, out.control);
      rows.add_own(posture, stack.own_spec(), stack.own_pairs());
      rows.add_floor(posture);
    }
    if (scene.perception != nullptr) rows.add_silent_views(clock.now(), posture, *scene.perception);
  }

  /// From the solution to the velocity that is sent: the only place that changes it.
  void limit() {
    const LimitOutput& limited = limiter.limit({.nominal = out.nominal_qd,
                                                .tasks = stack.tasks(),
                                                .caps = rows.caps(),
                                                .retreats = rows.retreats()});
    out.qd = limited.qd;
    out.limited = limited.limited();
    if (limited.pinched) note(Reason::kPinched, limited.n_retreats > 0 ? rows.nearest_link() : -1);
  }

  /// From the joint state and a cloud to an admissible velocity.
  /// @param sensed  the cloud is the sensors', row by row; else it is known
  void act(const JointVector& q, const PointsRef& cloud_W, bool sensed,
           const detail::ObstacleVelocities& given, const Pose& goal) {
    detail::Stopwatch watch(config.timings);
    find_nearest(cloud_W, sensed);  // Algorithm 2
    const detail::ObstacleVelocities velocities = velocities_of(cloud_W, sensed, given);
    find_each(cloud_W, velocities);
    nominal_speed.update(monitor.slowed(monitor.expected()), clock.elapsed(),
                         limiter.state().braking_time);
    stack.build(posture, cloud_W, velocities, goal, nominal_speed.share(),  // eqs. (4) to (10)
                control_points, trusted, out, monitor);
    gather({posture, cloud_W, velocities, sensed ? &perception : nullptr, clock.now()});
    out.timings.distance_us = watch.lap_us();
    solve(stack.tasks(), robot->n_q(), limits.qd_max, config.solver, solution);
    out.nominal_qd = solution.qd();  // [iCAT] (4.7), (4.8)
    if (stack.is_singular(out.nominal_qd)) note(Reason::kSingular);
    rows.report_blind_motion(out.nominal_qd, monitor);
    limit();
    out.timings.solve_us = watch.lap_us();
    execution.judge(clock.now(), stack, trusted, out, monitor);
    note_outside_limits(q);
  }

  void note_outside_limits(const JointVector& q) {
    if ((q.array() < limits.q_min.array() || q.array() > limits.q_max.array()).any())
      note(Reason::kOutsideLimits);
  }

  /// Who saw the pair's obstacle point, and when.
  void blame() {
    if (!out.pair) return;
    const Eigen::Index row = out.pair->point;
    out.pair_origin = perception.origins()[static_cast<std::size_t>(row)];
    out.pair_age = clock.now() - perception.stamp(row);
    out.pair_remembered = row >= perception.seen_points();
  }

  /// The mode that this tick's findings call for. STOP, and what leaves the arm's own state in
  /// doubt, brake instead of what was solved.
  /// @param acted  there is a command of this tick
  void conclude(const JointVector& q, bool acted) {
    out.mode = monitor.conclude(clock.now());
    if (!acted || monitor.brakes()) {
      out.qd = limiter.brake().qd;
      out.limited = {};
    }
    if (!acted) out.nominal_qd = out.qd;
    qd_last = out.qd;
    if (acted) {
      stack.report(out);
      following.command(clock.now(), q, out.qd);
    } else {
      following.clear();
    }
    history.add(clock.caller(), q, robot->n_q(), out, monitor.findings());
  }

  /// Begins the limit stage of this tick. @param q  the last that could be trusted
  void begin_limit(const JointVector& q, double age) {
    limiter.begin(q, qd_last, clock.elapsed(), std::isfinite(age) ? std::max(age, 0.0) : 0.0);
  }

  void begin(double time, bool late) {
    monitor.begin();
    monitor.deadline(late);
    if (!clock.advance(time)) note(Reason::kTimeInvalid);
    if (loop_rate.slow(clock.elapsed())) note(Reason::kLoopSlow);
    out.limited = {};
    out.pair.reset();
    out.pair_origin = {};
    out.pair_age = 0.0;
    out.pair_remembered = false;
    out.obstacle_velocity_W.setZero();
    out.trusted_distance = kInfinity;
    out.control = {};
    out.own = {};
    out.timings = {};
    for (int level = 0; level < out.n_tasks; ++level)
      out.tasks[static_cast<std::size_t>(level)] = {};
  }
};

Controller::Controller(std::shared_ptr<const Robot> robot, Skin skin, ControllerConfig config) {
  validate(config);
  impl_ = std::make_unique<Impl>(std::move(robot), std::move(skin), std::move(config));
}
Controller::~Controller() = default;

const TickOutput& Controller::tick(double time, const JointVector& q, std::span<const Scan> scans,
                                   const Pose& goal, bool late, std::optional<double> q_stamp) {
  Impl& me = *impl_;
  detail::Stopwatch watch(me.config.timings);
  me.begin(time, late);
  if (!me.mounts_accepted) me.note(Reason::kMountsUnchecked);
  const bool usable = me.joints_usable(time, q, q_stamp);
  me.begin_limit(usable ? q : me.posture.q, q_stamp ? time - *q_stamp : 0.0);
  if (usable) {
    me.perception.update(me.clock.now(), me.clock.delay(), q, scans, me.monitor);
    me.out.timings.sense_us = me.perception.sense_us;
    me.out.timings.filter_us = me.perception.filter_us;
    me.perception.freshness().check(me.clock.now(), me.monitor);
    me.robot->update(q, me.posture);
    me.perception.remember(me.clock.now(), me.posture, me.monitor);
    me.out.timings.memory_us = me.perception.memory_us;
    me.act(q, me.perception.cloud_W(), true, detail::ObstacleVelocities(me.none_W),
           me.usable_goal(goal));
    me.blame();
    me.trusted.watch(me.clock.now(), me.out, me.perception);
  }
  me.conclude(q, usable);
  me.out.timings.total_us = watch.lap_us();
  return me.out;
}

const TickOutput& Controller::tick_known(double time, const JointVector& q,
                                         const PointsRef& points_W, const Pose& goal,
                                         const PointsRef& velocities_W) {
  Impl& me = *impl_;
  detail::Stopwatch watch(me.config.timings);
  me.begin(time, false);
  bool usable = me.joints_usable(time, q, std::nullopt);
  me.begin_limit(usable ? q : me.posture.q, 0.0);
  const Eigen::Index rows = velocities_W.rows();
  if (points_W.rows() > me.config.max_points || !points_W.allFinite() ||
      (rows > 1 && rows != points_W.rows()) || !velocities_W.allFinite() ||
      (points_W.size() > 0 && points_W.cwiseAbs().maxCoeff() > kFarthest)) {
    me.note(Reason::kPointsInvalid);
    usable = false;
  }
  if (usable) {
    me.robot->update(q, me.posture);
    me.act(q, points_W, false, detail::ObstacleVelocities(velocities_W), me.usable_goal(goal));
  }
  me.conclude(q, usable);
  me.out.timings.total_us = watch.lap_us();
  return me.out;
}

std::span<const Finding> Controller::findings() const { return impl_->monitor.findings(); }
Eigen::Map<const Points> Controller::cloud_W() const { return impl_->perception.cloud_W(); }
std::span<const PointOrigin> Controller::cloud_origins() const {
  return impl_->perception.origins();
}
Eigen::Map<const Points> Controller::raw_cloud_W() const { return impl_->perception.raw_cloud_W(); }
Eigen::Index Controller::seen_points() const { return impl_->perception.seen_points(); }
std::vector<double> Controller::cloud_ages(double time) const {
  std::vector<double> ages(impl_->perception.origins().size());
  const double now = time + impl_->clock.delay();
  for (std::size_t row = 0; row < ages.size(); ++row)
    ages[row] = now - impl_->perception.stamp(static_cast<Eigen::Index>(row));
  return ages;
}
std::vector<double> Controller::scan_ages(double time) const {
  std::vector<double> ages(impl_->skin.mounts.size());
  const double now = time + impl_->clock.delay();
  for (std::size_t s = 0; s < ages.size(); ++s) ages[s] = impl_->perception.freshness().age(s, now);
  return ages;
}
const Robot& Controller::robot() const { return *impl_->robot; }
const Skin& Controller::skin() const { return impl_->skin; }
const ControllerConfig& Controller::config() const { return impl_->config; }
std::vector<TickRecord> Controller::last_ticks() const { return impl_->history.records(); }
void Controller::accept_mounts() { impl_->mounts_accepted = true; }
bool Controller::reset() {
  const bool left = impl_->monitor.reset();
  if (left) impl_->history.go_on();
  return left;
}
void Controller::retune(const std::vector<TaskSpec>& tasks) {
  impl_->config.tasks = detail::retuned(impl_->config, tasks, *impl_->robot).tasks;
  impl_->trusted.retune(tasks);
}
void Controller::go_on_from(const JointVector& qd) {
  const JointVector& most = impl_->limits.qd_max;
  const bool fits = qd.size() == most.size() && qd.allFinite() &&
                    (qd.cwiseAbs().array() <= most.array() + kSpeedRounding).all();
  require(fits, "qd", qd.transpose(),
          std::to_string(most.size()) + " finite numbers within the joints' speed limits");
  impl_->qd_last = qd;
  impl_->out.qd = qd;
  impl_->following.clear();
}

}  // namespace proxcgal
