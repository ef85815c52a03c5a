#include "proxcgal/controller.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "control_points.hpp"
#include "perception.hpp"
#include "proxcgal/error.hpp"
#include "stopwatch.hpp"

namespace proxcgal {
namespace {

constexpr double kLongestStep = 0.5;  // [s] a longer one between two ticks is a clock that jumped
constexpr double kExecuted = 0.5;     // share of the demanded rate that counts as executed
constexpr double kEngaged = 0.5;      // activation from which avoidance must be executed
constexpr double kRigid = 1e-6;       // how far a goal's rotation may be from orthonormal
constexpr double kFarthest = 1e9;     // [m] squares stay far inside single precision
constexpr double kBelieved = 0.1;     // [s] inside d_min: longer than one scan lasts
constexpr double kTouching = 1e-9;    // [m] nearer than this no normal is left
constexpr double kClockStep = 1e-3;   // [s] a stamp this far in the future is clock resolution
constexpr double kInto = 0.02;        // [m/s] slower motion into the unseen holds nothing up

/// Middle and corners of a sensor's field of view, in its frame.
std::array<Vector3, 5> view_directions(const SensorModel& model) {
  const double edge = std::tan(0.5 * model.field_of_view);
  std::array<Vector3, 5> directions{Vector3(0, 0, 1), Vector3(edge, edge, 1),
                                    Vector3(-edge, edge, 1), Vector3(edge, -edge, 1),
                                    Vector3(-edge, -edge, 1)};
  for (Vector3& direction : directions) direction.normalize();
  return directions;
}

double distance_of(const std::optional<ClosestPair>& pair) {
  if (!pair) return kInfinity;
  return pair->distance;
}

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
  Limits limits;

  // The internal clock advances with the caller's, and goes on through its jumps.
  bool started = false;
  double caller_time = 0.0, clock = 0.0;

  std::array<Vector3, 5> view_S;
  std::optional<Avoidance> avoidance;   // the first of the stack
  double stuck_since = -1.0;            // [s] internal, negative while avoidance is executed
  double near_since = 0.0;              // [s] internal, since when a pair has been inside d_min
  Vector3 outward_W = Vector3::Zero();  // last normal of a pair that was surely outside
  std::array<TickRecord, kKeptTicks> kept;
  std::size_t n_kept = 0;  // ever
  bool frozen = false;     // STOP came: what led to it stays

  bool by_sensors = false;  // this tick's cloud is the sensors', not known points

  JointVector qd_last;
  Posture posture;
  std::array<BuiltTask, kMaxLevels> built;
  std::array<Task, kMaxLevels> stack;
  Solution solution;
  TickOutput out;

  Impl(std::shared_ptr<const Robot> r, Skin s, ControllerConfig c)
      : robot(std::move(r)),
        skin(std::move(s)),
        config(std::move(c)),
        monitor(config.monitor),
        perception(robot, skin, config.filter, config.method),
        control_points(*robot, skin, config),
        limits{robot->q_min(), robot->q_max(), robot->qd_max(), robot->qdd_max()},
        view_S(view_directions(skin.model)),
        posture(robot->make_posture()) {
    for (const TaskSpec& task : config.tasks) proxcgal::validate(task, *robot);
    if (!limits.qd_max.allFinite() || !limits.qdd_max.allFinite()) {
      throw ConfigError("robot '" + robot->spec().name +
                        "' has a joint without a speed or acceleration limit: give both");
    }
    for (const TaskSpec& task : config.tasks) {
      const auto* spec = std::get_if<Avoidance>(&task);
      if (spec != nullptr && !avoidance) avoidance = *spec;
    }
    qd_last = JointVector::Zero(robot->n_q());
    out.qd = qd_last;
    out.n_tasks = static_cast<int>(config.tasks.size());
    perception.timings = config.timings;
  }

  void note(Reason reason, int link = -1, int count = 1) {
    Finding finding;
    finding.reason = reason;
    finding.link = link;
    finding.count = count;
    monitor.add(finding);
  }

  void advance(double time) {
    const double step = time - caller_time;
    if (!std::isfinite(time)) {
      clock += started ? config.period : 0.0;
      note(Reason::kTimeInvalid);
      return;
    }
    if (!started) {
      clock = 0.0;
    } else if (step > 0.0 && step <= kLongestStep) {
      clock += step;
    } else {
      clock += config.period;
      note(Reason::kTimeInvalid);
    }
    started = true;
    caller_time = time;
  }

  /// An age that is not a number, or below nothing, says that the stamp is of another clock.
  void judge_age(double age) {
    const bool known = age >= -kClockStep;  // written so that what is not a number is unknown
    if (known && age <= config.monitor.joints_hold_after) return;
    Finding stale;
    stale.reason = known && age > config.monitor.joints_stop_after ? Reason::kJointStateLost
                                                                   : Reason::kJointStateStale;
    stale.age = age;
    monitor.add(stale);
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

  void build(const Avoidance& spec, const PointsRef& cloud_W, const Vector3& velocity_W,
             BuiltTask& task) {
    std::span<const ControlPair> controls;
    if (config.control_point == ControlPoint::kSensor) {
      controls = control_points.sensor(skin, posture, cloud_W, velocity_W);
    } else if (spec.nearest > 1) {
      controls = control_points.links(*robot, posture, cloud_W, spec.nearest, velocity_W, monitor);
    } else if (out.pair) {
      controls = control_points.one(control_of_pair(velocity_W));
    }
    if (!controls.empty()) out.control = controls.front();
    build_avoidance(spec, *robot, posture, controls, task);
  }

  /// The pair as avoidance takes it: the trusted distance, and a normal that never turns over.
  ControlPair control_of_pair(const Vector3& velocity_W) const {
    ControlPair control;
    control.link = out.pair->link;
    control.control_W = out.pair->surface_W;
    control.obstacle_W = out.pair->obstacle_W;
    control.obstacle_velocity_W = velocity_W;
    control.distance = out.trusted_distance;
    control.fallback_normal_W = outward_W;
    return control;
  }

  Vector3 middle_W(int link) const {
    return posture.T_WL[static_cast<std::size_t>(link)] * robot->tree(link).bounds().center;
  }

  bool is_inside(const ClosestPair& pair) const {
    const Pose& T_WL = posture.T_WL[static_cast<std::size_t>(pair.link)];
    return robot->tree(pair.link).inside(T_WL.linear().transpose() *
                                         (pair.obstacle_W - T_WL.translation()));
  }

  /// Is the pair's distance to be shortened, or turned over?
  void trust(const PointsRef& cloud_W, bool sensed) {
    const Vector3 apart =
        out.pair ? Vector3(out.pair->surface_W - out.pair->obstacle_W) : Vector3(Vector3::Zero());
    out.trusted_distance = distance_of(out.pair);
    if (!sensed) {
      if (!out.pair) return;
      if (is_inside(*out.pair)) out.trusted_distance = -out.pair->distance;
      // Where the point is on the surface, and no normal held before: out from the link's centre.
      if (apart.norm() > kTouching) {
        outward_W = apart.normalized() * (out.trusted_distance < 0.0 ? -1.0 : 1.0);
      } else if (outward_W.isZero()) {
        outward_W = (middle_W(out.pair->link) - out.pair->obstacle_W).normalized();
      }
      return;
    }
    for (int s = 0; s < perception.sensors(); ++s) {
      const auto sensor = static_cast<std::size_t>(s);
      const double late = perception.age(sensor, clock) - config.monitor.fresh_within;
      const auto [begin, count] = perception.cloud_rows(sensor);
      if (!(late > 0.0) || count == 0) continue;
      const double shorter = config.monitor.approach_speed * late;
      ClosestPair pair = control_points.nearest_of(
          *robot, posture, cloud_W.middleRows(begin, count), out.trusted_distance + shorter);
      if (!pair.found()) continue;
      pair.point += static_cast<int>(begin);
      out.pair = pair;
      out.trusted_distance = std::max(pair.distance - shorter, 0.0);
    }
    if (!out.pair) return;
    if (!perception.in_contact()) {
      if (out.pair->distance > 0.0) {
        outward_W = (out.pair->surface_W - out.pair->obstacle_W).normalized();
      }
      return;
    }
    note(Reason::kContact, out.pair->link);
    // Taken for body, so as near as noise: whether the point measured is in or out of the surface,
    // the normal that held before does.
    if (apart.dot(outward_W) < 0.0) out.trusted_distance = -out.pair->distance;
  }

  /// Which zone must not lose its obstacle to the body filter. What was seen in one scan only may
  /// be noise on the body itself.
  void watch() {
    const bool near = avoidance && out.pair && out.trusted_distance < avoidance->d_min;
    if (!near) near_since = clock;
    if (near && clock - near_since > kBelieved) {
      perception.watch({out.pair_origin, out.pair->obstacle_W});
    } else {
      perception.watch({});
    }
  }

  /// Into what is not seen nothing may move fast, and inside d_min nothing may come nearer: the
  /// second has the last word, because that obstacle is known to be there.
  void restrain(const Admissible& box, const Vector3& velocity_W) {
    for (int s = 0; by_sensors && s < perception.sensors(); ++s) {
      const auto sensor = static_cast<std::size_t>(s);
      const double blind = perception.blind_for(sensor, clock, config.monitor);
      if (blind > config.monitor.degraded_after) slow_into_view(s, blind, box);
    }
    const bool whole_body = config.control_point == ControlPoint::kWholeBody;
    if (whole_body && avoidance && out.pair && out.trusted_distance < avoidance->d_min) {
      const ControlPair control = control_of_pair(velocity_W);
      const JointVector row = opening_row(*robot, posture, control);
      keep_rate(row, 0.0, box, out.qd);
    }
  }

  void slow_into_view(int s, double blind, const Admissible& box) {
    const auto sensor = static_cast<std::size_t>(s);
    const int link = perception.link(sensor);
    const Pose T_WS = posture.T_WL[static_cast<std::size_t>(link)] * perception.T_LS(sensor);
    Jacobian6 J;
    robot->jacobian(posture, link, T_WS.translation(), J);
    const double from = config.monitor.degraded_after, to = config.monitor.hold_after;
    const double share = to > from ? std::clamp((to - blind) / (to - from), 0.0, 1.0) : 0.0;
    const double allowed = share * config.monitor.blind_speed;
    double into = 0.0;
    for (const Vector3& view : view_S) {
      const JointVector row = -(J.topRows<3>().transpose() * (T_WS.linear() * view));
      into = std::max(into, -row.dot(out.qd));
      keep_rate(row, -allowed, box, out.qd);
    }
    if (blind > to && into > kInto) {
      Finding finding;
      finding.reason = Reason::kBlindMotion;
      finding.sensor = s;
      finding.age = blind;
      monitor.add(finding);
    }
  }

  void build_stack(const PointsRef& cloud_W, const Vector3& velocity_W, const Pose& goal) {
    for (std::size_t level = 0; level < config.tasks.size(); ++level) {
      BuiltTask& task = built[level];
      task.smallest_row_norm = kInfinity;
      std::visit(
          [&](const auto& spec) {
            using Spec = std::decay_t<decltype(spec)>;
            if constexpr (std::is_same_v<Spec, Avoidance>) build(spec, cloud_W, velocity_W, task);
            if constexpr (std::is_same_v<Spec, Reach>)
              build_reach(spec, *robot, posture, goal, task);
            if constexpr (std::is_same_v<Spec, JointLimits>)
              build_joint_limits(spec, *robot, posture, task);
            if constexpr (std::is_same_v<Spec, MinimumAltitude>)
              build_minimum_altitude(spec, *robot, posture, task);
            if constexpr (std::is_same_v<Spec, Manipulability>)
              build_manipulability(spec, *robot, posture, task);
          },
          config.tasks[level]);
      if (task.smallest_row_norm < kSmallRowNorm && task.task.activation.maxCoeff() > 0.0) {
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

  /// Was avoidance asked for more than the command gives?
  void judge() {
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
          const bool inside = config.control_point == ControlPoint::kWholeBody &&
                              out.trusted_distance < avoidance->d_min;
          if (!inside) {
            stuck_since = -1.0;
          } else if (stuck_since < 0.0) {
            stuck_since = clock;
          } else if (clock - stuck_since > config.monitor.stuck_after) {
            note(Reason::kAvoidanceStuck, out.control.link);
          }
          return;
        }
      }
    }
    stuck_since = -1.0;
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
  /// @param sensed  the cloud is the sensors', row by row
  void act(const JointVector& q, const PointsRef& cloud_W, bool sensed, const Vector3& velocity_W,
           const Pose& goal) {
    detail::Stopwatch watch(config.timings);
    robot->update(q, posture);
    by_sensors = sensed;
    const double d_min = avoidance ? avoidance->d_min : 0.0;
    out.pair =
        control_points.nearest(clock, *robot, posture, cloud_W, d_min, engaged_within(), monitor);
    trust(cloud_W, sensed);
    build_stack(cloud_W, velocity_W, goal);
    out.timings.distance_us = watch.lap_us();
    const std::span<const Task> tasks(stack.data(), config.tasks.size());
    solve(tasks, robot->n_q(), limits.qd_max, config.solver, solution);
    // By the last tick's mode: this one's findings are not complete yet.
    const double scale = monitor.slowed() ? config.monitor.degraded_scale : 1.0;
    const Admissible box = admissible(limits, q, qd_last, config.period, scale);
    command({solution.rho.data(), static_cast<std::size_t>(solution.levels) + 1}, tasks, qd_last,
            box, out.qd);
    restrain(box, velocity_W);
    out.timings.solve_us = watch.lap_us();
    judge();
    if ((q.array() < limits.q_min.array() || q.array() > limits.q_max.array()).any())
      note(Reason::kOutsideLimits);
  }

  /// The mode that this tick's findings call for; HOLD and STOP brake instead of what was solved.
  void conclude(const JointVector& q, bool usable) {
    out.mode = monitor.conclude();
    if (!usable || out.mode >= Mode::kHold) {
      const JointVector& at = usable ? q : posture.q;  // the last posture that could be trusted
      const Admissible box = admissible(limits, at, qd_last, config.period, 1.0);
      decelerate(qd_last, box, out.qd);
      if (usable) restrain(box, Vector3::Zero());
    }
    qd_last = out.qd;
    if (usable) report();
    remember(q);
  }

  void remember(const JointVector& q) {
    if (frozen) return;
    TickRecord& record = kept[n_kept++ % kKeptTicks];
    record.time = caller_time;
    record.mode = out.mode;
    record.q = q.size() == robot->n_q() ? q : JointVector::Constant(robot->n_q(), kInfinity);
    record.qd = out.qd;
    record.distance = distance_of(out.pair);
    record.link = out.pair ? out.pair->link : -1;
    record.origin = out.pair_origin;
    record.n_findings = static_cast<int>(monitor.findings().size());
    const auto first =
        monitor.findings().first(std::min(monitor.findings().size(), record.findings.size()));
    std::copy(first.begin(), first.end(), record.findings.begin());
    frozen = out.mode == Mode::kStop;
  }

  void begin(double time, bool late) {
    monitor.begin();
    monitor.deadline(late);
    advance(time);
    out.pair.reset();
    out.pair_origin = {};
    out.trusted_distance = kInfinity;
    out.control = {};
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
  const bool usable = me.usable(time, q, q_stamp, goal);
  if (usable) {
    me.perception.update(me.clock, me.clock - me.caller_time, q, scans, me.monitor);
    me.out.timings.sense_us = me.perception.sense_us;
    me.out.timings.filter_us = me.perception.filter_us;
    me.perception.check_freshness(me.clock, me.config.monitor, me.monitor);
    me.act(q, me.perception.cloud_W(), true, Vector3::Zero(), goal);
    if (me.out.pair)
      me.out.pair_origin = me.perception.origins()[static_cast<std::size_t>(me.out.pair->point)];
    me.watch();
  }
  me.conclude(q, usable);
  me.out.timings.total_us = watch.lap_us();
  return me.out;
}

const TickOutput& Controller::tick_known(double time, const JointVector& q,
                                         const PointsRef& points_W, const Pose& goal,
                                         const Vector3& velocity_W) {
  Impl& me = *impl_;
  detail::Stopwatch watch(me.config.timings);
  me.begin(time, false);
  bool usable = me.usable(time, q, std::nullopt, goal);
  if (points_W.rows() > me.config.max_points || !points_W.allFinite() || !velocity_W.allFinite() ||
      (points_W.size() > 0 && points_W.cwiseAbs().maxCoeff() > kFarthest)) {
    me.note(Reason::kPointsInvalid);
    usable = false;
  }
  if (usable) me.act(q, points_W, false, velocity_W, goal);
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
std::vector<double> Controller::scan_ages(double time) const {
  std::vector<double> ages(impl_->skin.mounts.size());
  const double now = impl_->clock + (time - impl_->caller_time);
  for (std::size_t s = 0; s < ages.size(); ++s) ages[s] = impl_->perception.age(s, now);
  return ages;
}
const Robot& Controller::robot() const { return *impl_->robot; }
const Skin& Controller::skin() const { return impl_->skin; }
const ControllerConfig& Controller::config() const { return impl_->config; }
std::vector<TickRecord> Controller::last_ticks() const {
  const std::size_t n = std::min<std::size_t>(impl_->n_kept, kKeptTicks);
  std::vector<TickRecord> records;
  for (std::size_t back = n; back > 0; --back)
    records.push_back(impl_->kept[(impl_->n_kept - back) % kKeptTicks]);
  return records;
}
bool Controller::reset() {
  const bool left = impl_->monitor.reset();
  if (left) impl_->frozen = false;
  return left;
}

}  // namespace proxcgal
