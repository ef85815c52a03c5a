#include "limit_names.hpp"
#include "proxcgal/pipeline/limit.hpp"
#include "stack_arguments.hpp"
#include "topics.hpp"

namespace proxcgal::binding {
namespace {

Limits make_limits(nb::handle q_min, nb::handle q_max, nb::handle qd_max, nb::handle qdd_max) {
  const JointVector speed = joints_from(qd_max, "qd_max");
  const Eigen::Index n = speed.size();
  return {limits_from(q_min, "q_min", n, -kInfinity, ""),
          limits_from(q_max, "q_max", n, -kInfinity, ""), speed,
          limits_from(qdd_max, "qdd_max", n, 0.0, "at least 0")};
}

/// A limiter and the sizes that it takes.
struct BoundLimiter {
  Eigen::Index n;
  Limiter limiter;
};

/// A copy that a user may keep.
struct Limited {
  Eigen::VectorXd qd, low, high, qd_brake;
  const char* status;
  std::vector<ActiveLimit> rows;
  bool pinched;
  double stand;
};

Limited limited(BoundLimiter& self, nb::handle q, nb::handle qd_last, double elapsed,
                nb::handle nominal, const std::vector<Task>& tasks,
                const std::vector<ApproachCap>& caps, const std::vector<RetreatRow>& retreats) {
  const JointVector wanted = vector_from(nominal, "nominal", self.n, Take::kConvert, false);
  require_joints(tasks, self.n);
  const LimitState& state =
      self.limiter.begin(vector_from(q, "q", self.n, Take::kConvert, false),
                         vector_from(qd_last, "qd_last", self.n, Take::kConvert, false), elapsed);
  const LimitOutput& out = self.limiter.limit({wanted, tasks, caps, retreats});
  return {out.qd,
          state.interval.low,
          state.interval.high,
          state.qd_brake,
          status_name(out.status),
          {out.limited().begin(), out.limited().end()},
          out.pinched,
          out.stand};
}

}  // namespace

void bind_limit(nb::module_& m) {
  nb::class_<ApproachCap>(m, "ApproachCap", "row @ qd >= -c: a distance that may not close faster.")
      .def(
          "__init__",
          [](ApproachCap* self, nb::handle row, double distance, double stop, double near,
             double speed) {
            new (self) ApproachCap{.row = joints_from(row, "row"),
                                   .distance = distance,
                                   .stop = stop,
                                   .near = near,
                                   .speed = speed};
          },
          "row"_a, nb::kw_only(), "distance"_a = ApproachCap{}.distance,
          "stop"_a = ApproachCap{}.stop, "near"_a = ApproachCap{}.near,
          "speed"_a = ApproachCap{}.speed);
  nb::class_<RetreatRow>(m, "RetreatRow", "row @ qd + s >= rate: a distance that is to open.")
      .def(
          "__init__",
          [](RetreatRow* self, nb::handle row, double distance, double d_min, double gain,
             double obstacle_rate) {
            new (self) RetreatRow{.row = joints_from(row, "row"),
                                  .distance = distance,
                                  .d_min = d_min,
                                  .gain = gain,
                                  .obstacle_rate = obstacle_rate};
          },
          "row"_a, nb::kw_only(), "distance"_a, "d_min"_a = RetreatRow{}.d_min,
          "gain"_a = RetreatRow{}.gain, "obstacle_rate"_a = RetreatRow{}.obstacle_rate);
  nb::class_<Limited>(m, "LimitedVelocity", "Output of `Limiter.limit`.")
      .def_ro("qd", &Limited::qd, "(n,) inside every limit [rad/s or m/s].")
      .def_ro("low", &Limited::low, "(n,) least velocity that each joint may take.")
      .def_ro("high", &Limited::high, "(n,) largest velocity that each joint may take.")
      .def_ro("qd_brake", &Limited::qd_brake, "(n,) all joints brake together.")
      .def_ro("status", &Limited::status, "'unchanged', 'limited', 'partly' or 'braking'.")
      .def_ro("pinched", &Limited::pinched, "Do retreat rows contradict one another?")
      .def_ro("stand", &Limited::stand, "Share taken off the nominal velocity where pinched.")
      .def_prop_ro(
          "rows",
          [](const Limited& self) {
            std::vector<std::string> kinds;
            for (const ActiveLimit& row : self.rows) kinds.emplace_back(kind_name(row.kind));
            return kinds;
          },
          "Kinds of the rows that changed the velocity.");
  nb::class_<BoundLimiter>(m, "Limiter", "The limit stage by itself.")
      .def(
          "__init__",
          [](BoundLimiter* self, nb::handle q_min, nb::handle q_max, nb::handle qd_max,
             nb::handle qdd_max, const LimitConfig& config, double period) {
            const Limits limits = make_limits(q_min, q_max, qd_max, qdd_max);
            new (self) BoundLimiter{limits.qd_max.size(), Limiter(limits, config, period)};
          },
          "q_min"_a, "q_max"_a, "qd_max"_a, "qdd_max"_a, "config"_a = LimitConfig{},
          "period"_a = 0.01)
      .def("limit", &limited, "q"_a, "qd_last"_a, "elapsed"_a, "nominal"_a,
           "tasks"_a = std::vector<Task>{}, "caps"_a = std::vector<ApproachCap>{},
           "retreats"_a = std::vector<RetreatRow>{},
           "The velocity nearest to `nominal` that the joints' limits, the caps and, as far as can "
           "be, the retreat rows allow.");
}

}  // namespace proxcgal::binding
