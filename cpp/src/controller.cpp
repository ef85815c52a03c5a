#include "proxcgal/controller.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "caution.hpp"
#include "control_points.hpp"
#include "internal_clock.hpp"
#include "own_pairs.hpp"
#include "perception.hpp"
#include "proxcgal/error.hpp"
#include "stopwatch.hpp"
#include "tick_history.hpp"
#include "velocities.hpp"

namespace proxcgal {
namespace {

constexpr double kExecuted = 0.5;     // share of the demanded rate that counts as executed
constexpr double kEngaged = 0.5;      // activation from which avoidance must be executed
constexpr double kJustBeyond = 1e-6;  // [m]
constexpr double kRounding = 1e-9;    // [s] of sums of periods: it decides about no tick
constexpr double kRigid = 1e-6;       // how far a goal's rotation may be from orthonormal

bool is_rigid(const Pose& T) {
  return T.matrix().allFinite() &&
         (T.linear() * T.linear().transpose() - Eigen::Matrix3d::Identity()).norm() < kRigid &&
         T.linear().determinant() > 0.0;
}

}  // namespace

struct Controller::Impl {
  std::shared_ptr<const Robot> robot;
  Skin skin;
  ControllerConfig config;
  Monitor monitor;
  detail::Perception perception;
  detail::ControlPoints control_points;
  detail::OwnPairs own_pairs;
  detail::Caution caution;
  Limits limits;
  detail::InternalClock clock;

  detail::TickHistory history;
  double stuck_since = -1.0;  // [s] internal, negative while avoidance is executed
  bool mounts_accepted;

  JointVector qd_last;
  Posture posture;
  const Points none_W = Points(0, 3);
  Points estimate_W = Points::Zero(1, 3);  // velocity of the closest obstacle [m/s]
  std::array<BuiltTask, kMaxLevels> built;
  std::array<Task, kMaxLevels> stack;
  Solution solution;
  TickOutput out;

  Impl(std::shared_ptr<const Robot> r, Skin s, ControllerConfig c)
      : robot(std::move(r)),
        skin(std::move(s)),
        config(std::move(c)),
        monitor(config.monitor),
        perception(robot, skin, config),
        control_points(*robot, skin, config),
        own_pairs(*robot, config),
        caution(*robot, skin, config),
        limits{robot->q_min(), robot->q_max(), robot->qd_max(), robot->qdd_max()},
        clock(config.period),
        mounts_accepted(!config.monitor.await_mounts),
        posture(robot->make_posture()) {
    for (const TaskSpec& task : config.tasks) proxcgal::validate(task, *robot);
    if (!limits.qd_max.allFinite() || !limits.qdd_max.allFinite()) {
      throw ConfigError("robot '" + robot->spec().name +
                        "' has a joint without a speed or acceleration limit: give both");
    }
    qd_last = JointVector::Zero(robot->n_q());
    out.qd = qd_last;
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

  /// Joint state and goal are usable; else the reason is noted.
  bool usable(double time, const JointVector& q, std::optional<double> q_stamp, const Pose& goal) {
    const bool joints = q.size() == robot->n_q() && q.allFinite();
    if (!joints) note(Reason::kJointStateInvalid);
    if (q_stamp) judge_age(time - *q_stamp);
    const bool rigid = is_rigid(goal);
    if (!rigid) note(Reason::kGoalInvalid);
    return joints && rigid;
  }

  void build(const Avoidance& spec, const PointsRef& cloud_W, const detail::Velocities& velocities,
             BuiltTask& task) {
    std::span<const ControlPair> controls;
    if (config.control_point == ControlPoint::kSensor) {
      controls = control_points.sensor(skin, posture, cloud_W, velocities);
    } else if (spec.nearest > 1) {
      // The nearest link is told even where nothing is active yet.
      const double nearest =
          out.pair_distance() < kInfinity ? out.pair_distance() + kJustBeyond : 0.0;
      const double within = std::max(spec.d_min + spec.buffer, nearest);
      controls =
          control_points.links(*robot, posture, cloud_W, spec.nearest, within, velocities, monitor);
    } else if (out.pair) {
      controls = control_points.one(caution.control(out, velocities.of(out.pair->point)));
    }
    if (!controls.empty()) out.control = controls.front();
    build_avoidance(spec, *robot, posture, controls, task);
  }

  void build(const SelfCollision& spec, BuiltTask& task) {
    const std::span<const LinkPair> pairs = own_pairs.nearest(spec, *robot, posture, monitor);
    if (!pairs.empty()) out.own = pairs.front();
    build_self_collision(spec, *robot, posture, pairs, task);
  }

  void build_stack(const PointsRef& cloud_W, const detail::Velocities& velocities,
                   const Pose& goal) {
    for (std::size_t level = 0; level < config.tasks.size(); ++level) {
      BuiltTask& task = built[level];
      task.smallest_row_norm = kInfinity;
      std::visit(
          [&](const auto& spec) {
            using Spec = std::decay_t<decltype(spec)>;
            if constexpr (std::is_same_v<Spec, Avoidance>) build(spec, cloud_W, velocities, task);
            if constexpr (std::is_same_v<Spec, Reach>)
              build_reach(spec, *robot, posture, goal, task);
            if constexpr (std::is_same_v<Spec, JointLimits>)
              build_joint_limits(spec, *robot, posture, task);
            if constexpr (std::is_same_v<Spec, MinimumAltitude>)
              build_minimum_altitude(spec, *robot, posture, task);
            if constexpr (std::is_same_v<Spec, Manipulability>)
              build_manipulability(spec, *robot, posture, task);
            if constexpr (std::is_same_v<Spec, SelfCollision>) build(spec, task);
          },
          config.tasks[level]);
      const bool active = (task.task.activation.array() > 0.0).any();
      if (task.smallest_row_norm < kSmallRowNorm && active) {
        note(Reason::kRowSmall);
      }
      stack[level] = task.task;
    }
  }

  /// Within this distance having nothing to move away is a cause to hold [m].
  double engaged_within() const {
    double reach = 0.0;
    if (config.control_point == ControlPoint::kSensor) return reach;  // another point is moved
    for (const TaskSpec& task : config.tasks) {
      if (const auto* avoid = std::get_if<Avoidance>(&task))
        reach = std::max(reach, avoid->d_min + avoid->buffer);
    }
    return reach;
  }

  /// Avoidance makes up what the command gives it less than the solver does, with the joints of
  /// which no more important task of another kind wants anything now.
  void catch_up_avoidance(std::span<const JointVector> levels, const Admissible& box) {
    for (std::size_t level = config.tasks.size(); level-- > 0;) {
      if (!std::holds_alternative<Avoidance>(config.tasks[level])) continue;
      Admissible free = box;
      for (std::size_t upper = 0; upper < level; ++upper) {
        if (std::holds_alternative<Avoidance>(config.tasks[upper])) continue;
        const Task& task = stack[upper];
        for (Eigen::Index row = 0; row < task.activation.size(); ++row) {
          if (!(task.activation[row] > 0.0)) continue;
          for (Eigen::Index joint = 0; joint < out.qd.size(); ++joint) {
            if (task.jacobian(row, joint) == 0.0) continue;
            free.low[joint] = free.high[joint] = out.qd[joint];
          }
        }
      }
      catch_up(levels, stack[level], free, out.qd);
    }
  }

  /// Is it acceleration alone that avoidance is short of, as after a HOLD that has cleared? Then
  /// the position and velocity limits let the row have its share once there was time.
  bool in_time(std::size_t level, Eigen::Index row, const Admissible& box) const {
    Admissible steady = box;
    steady.low = box.steady_low;
    steady.high = box.steady_high;
    JointVector qd = out.qd;
    command({solution.rho.data(), static_cast<std::size_t>(solution.levels) + 1},
            std::span<const Task>(stack.data(), config.tasks.size()), qd_last, steady, qd);
    return !(residual(stack[level], qd)[row] > kExecuted * stack[level].rate[row]);
  }

  /// Was avoidance asked for more than the command gives?
  /// @param cut_back  the command was cut back for what is not seen: more time would not help
  void judge(const Admissible& box, bool cut_back) {
    for (std::size_t level = 0; level < config.tasks.size(); ++level) {
      if (!std::holds_alternative<Avoidance>(config.tasks[level])) continue;
      const Task& task = stack[level];
      const RowVector missing = residual(task, out.qd);
      for (Eigen::Index row = 0; row < task.rate.size(); ++row) {
        const bool engaged = task.activation[row] > kEngaged && task.rate[row] > 0.0;
        if (engaged && missing[row] > kExecuted * task.rate[row]) {
          note(Reason::kNotExecuted, out.control.link);
          // Outside d_min the goal may well hold against it: there the arm may come to rest.
          // The baseline moves another point than the pair's, and is left as it is published.
          const bool whole_body = config.control_point == ControlPoint::kWholeBody;
          stuck(whole_body && caution.inside(out) && (cut_back || !in_time(level, row, box)));
          return;
        }
      }
    }
    stuck(false);
  }

  void stuck(bool now) {
    if (!now) {
      stuck_since = -1.0;
    } else if (stuck_since < 0.0) {
      stuck_since = clock.now();
    } else if (clock.now() - stuck_since > config.monitor.stuck_after + kRounding) {
      note(Reason::kAvoidanceStuck, out.control.link);
    }
  }

  /// The limits of a nominal period, with no more change of velocity than the time since the last
  /// command allows: a tick may come early. Braking in time stays possible: until the next command
  /// the joint moves at this one for a nominal period at most.
  Admissible admissible_now(const JointVector& q, double scale) const {
    Admissible box = admissible(limits, q, qd_last, config.period, scale);
    const JointVector change = clock.step() * limits.qdd_max;
    box.low = box.steady_low.cwiseMax(qd_last - change).cwiseMin(qd_last + change);
    box.high = box.steady_high.cwiseMax(qd_last - change).cwiseMin(qd_last + change);
    return box;
  }

  /// What each task wanted, and what is missing of it in the command that is issued.
  void report() {
    for (std::size_t level = 0; level < config.tasks.size(); ++level) {
      const Task& task = stack[level];
      out.tasks[level] = {task_name(config.tasks[level]), task.rate, task.activation,
                          residual(task, out.qd)};
    }
  }

  /// From the joint state and a cloud to an admissible velocity.
  /// @param sensed  the cloud is the sensors', row by row; else it is known
  void act(const JointVector& q, const PointsRef& cloud_W, bool sensed,
           const detail::Velocities& velocities, const Pose& goal) {
    detail::Stopwatch watch(config.timings);
    out.pair = control_points.nearest(clock.now(), *robot, posture, cloud_W, caution.d_min(),
                                      engaged_within(), monitor);
    if (sensed) {
      caution.trust_sensed(clock.now(), posture, perception, control_points, out, monitor);
    } else {
      caution.trust_known(posture, out);
    }
    if (out.pair) out.obstacle_velocity_W = velocities.of(out.pair->point);
    if (out.pair && sensed && config.motion) {
      const Vector3& obstacle_W = out.pair->obstacle_W;
      out.obstacle_velocity_W = perception.velocity_W(clock.now(), obstacle_W);
      estimate_W.row(0) = out.obstacle_velocity_W.transpose();
      const PointsRef moving_W(estimate_W);
      const detail::Velocities estimated(moving_W, cloud_W, obstacle_W, config.motion->radius);
      build_stack(cloud_W, estimated, goal);
    } else {
      build_stack(cloud_W, velocities, goal);
    }
    out.timings.distance_us = watch.lap_us();
    const std::span<const Task> tasks(stack.data(), config.tasks.size());
    solve(tasks, robot->n_q(), limits.qd_max, config.solver, solution);
    // By the last tick's mode: this one's findings are not complete yet.
    const double scale = monitor.slowed() ? config.monitor.degraded_scale : 1.0;
    const Admissible box = admissible_now(q, scale);
    const std::span<const JointVector> levels(solution.rho.data(),
                                              static_cast<std::size_t>(solution.levels) + 1);
    command(levels, tasks, qd_last, box, out.qd);
    catch_up_avoidance(levels, box);
    // What is known to be there has the last word over what may be where nothing is seen.
    const JointVector solved = out.qd;
    if (sensed) caution.slow_into_unseen(clock.now(), posture, perception, box, out, monitor);
    const bool cut_back = (out.qd.array() != solved.array()).any();
    caution.keep_off(posture, box, out);
    out.timings.solve_us = watch.lap_us();
    judge(box, cut_back);
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

  /// The mode that this tick's findings call for; HOLD and STOP brake instead of what was solved.
  void conclude(const JointVector& q, bool usable) {
    out.mode = monitor.conclude();
    if (!usable || out.mode >= Mode::kHold) {
      const JointVector& at = usable ? q : posture.q;  // the last posture that could be trusted
      const Admissible box = admissible_now(at, 1.0);
      decelerate(qd_last, box, out.qd);
      if (usable) caution.keep_off(posture, box, out);
    }
    qd_last = out.qd;
    if (usable) report();
    history.add(clock.caller(), q, robot->n_q(), out, monitor.findings());
  }

  void begin(double time, bool late) {
    monitor.begin();
    monitor.deadline(late);
    if (!clock.advance(time)) note(Reason::kTimeInvalid);
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
  config.validate();
  impl_ = std::make_unique<Impl>(std::move(robot), std::move(skin), std::move(config));
}
Controller::~Controller() = default;

const TickOutput& Controller::tick(double time, const JointVector& q, std::span<const Scan> scans,
                                   const Pose& goal, bool late, std::optional<double> q_stamp) {
  Impl& me = *impl_;
  detail::Stopwatch watch(me.config.timings);
  me.begin(time, late);
  if (!me.mounts_accepted) me.note(Reason::kMountsUnchecked);
  const bool usable = me.usable(time, q, q_stamp, goal);
  if (usable) {
    me.perception.update(me.clock.now(), me.clock.delay(), q, scans, me.monitor);
    me.out.timings.sense_us = me.perception.sense_us;
    me.out.timings.filter_us = me.perception.filter_us;
    me.perception.freshness().check(me.clock.now(), me.monitor);
    me.robot->update(q, me.posture);
    me.perception.remember(me.clock.now(), me.posture, me.monitor);
    me.out.timings.memory_us = me.perception.memory_us;
    me.act(q, me.perception.cloud_W(), true, detail::Velocities(me.none_W), goal);
    me.blame();
    me.caution.watch(me.clock.now(), me.out, me.perception);
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
  bool usable = me.usable(time, q, std::nullopt, goal);
  const Eigen::Index rows = velocities_W.rows();
  if (points_W.rows() > me.config.max_points || !points_W.allFinite() ||
      (rows > 1 && rows != points_W.rows()) || !velocities_W.allFinite() ||
      (points_W.size() > 0 && points_W.cwiseAbs().maxCoeff() > kFarthest)) {
    me.note(Reason::kPointsInvalid);
    usable = false;
  }
  if (usable) me.robot->update(q, me.posture);
  if (usable) me.act(q, points_W, false, detail::Velocities(velocities_W), goal);
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
  std::vector<TaskSpec>& mine = impl_->config.tasks;
  const bool same =
      std::equal(tasks.begin(), tasks.end(), mine.begin(), mine.end(),
                 [](const TaskSpec& a, const TaskSpec& b) { return a.index() == b.index(); });
  if (!same) {
    std::string names;
    for (const TaskSpec& task : mine)
      names += std::string(names.empty() ? "" : ", ") + task_name(task);
    throw ConfigError("tasks: other values are taken for the same tasks in the same order: " +
                      names);
  }
  for (std::size_t level = 0; level < tasks.size(); ++level) {
    const auto* to = std::get_if<SelfCollision>(&tasks[level]);
    if (to != nullptr && to->pairs != std::get<SelfCollision>(mine[level]).pairs)
      throw ConfigError("self_collision.pairs: are chosen at set-up; the other values may change");
  }
  ControllerConfig changed = impl_->config;
  changed.tasks = tasks;
  changed.validate();
  for (const TaskSpec& task : tasks) proxcgal::validate(task, *impl_->robot);
  mine = tasks;
  impl_->caution.retune(tasks);
}

}  // namespace proxcgal
