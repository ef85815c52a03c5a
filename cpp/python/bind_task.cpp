#include <nanobind/stl/pair.h>

#include "convert.hpp"
#include "proxcgal/pipeline/task.hpp"
#include "topics.hpp"

namespace proxcgal::binding {
namespace {

constexpr std::pair<const char*, ReachRows> kReachRows[] = {
    {"both", ReachRows::kBoth},
    {"position", ReachRows::kPosition},
    {"orientation", ReachRows::kOrientation}};

template <class Spec>
void construct(Spec* self, const Spec& spec) {
  spec.validate();
  new (self) Spec(spec);
}

}  // namespace

void bind_task(nb::module_& m) {
  const char* raises = "Raises: ConfigError with field, value and bound.";
  nb::class_<Avoidance>(
      m, "Avoidance",
      "Keep the robot away from the nearest obstacle. Source: [WA] eqs. (4) to (7).")
      .def(
          "__init__",
          [](Avoidance* self, double d_min, double buffer, double gain, int nearest) {
            construct(self, {d_min, buffer, gain, nearest});
          },
          nb::kw_only(), "d_min"_a = Avoidance{}.d_min, "buffer"_a = Avoidance{}.buffer,
          "gain"_a = Avoidance{}.gain, "nearest"_a = Avoidance{}.nearest, raises)
      .def_rw("d_min", &Avoidance::d_min, "[m] distance to keep.")
      .def_rw("buffer", &Avoidance::buffer, "[m] the activation rises from 0 to 1 inside it.")
      .def_rw("gain", &Avoidance::gain, "[1/s] lambda.")
      .def_rw("nearest", &Avoidance::nearest, "This many nearest links, one row each.");
  nb::class_<Reach>(
      m, "Reach",
      "Bring the tool to the goal, both rates saturated. Source: [WA] eqs. (8) to (10).")
      .def(
          "__init__",
          [](Reach* self, double gain, double max_linear, double max_angular,
             const std::string& rows) {
            construct(self,
                      {gain, max_linear, max_angular, choice(rows, "Reach.rows", kReachRows)});
          },
          nb::kw_only(), "gain"_a = Reach{}.gain, "max_linear"_a = Reach{}.max_linear,
          "max_angular"_a = Reach{}.max_angular, "rows"_a = "both", raises)
      .def_rw("gain", &Reach::gain, "[1/s] lambda.")
      .def_rw("max_linear", &Reach::max_linear, "[m/s]")
      .def_rw("max_angular", &Reach::max_angular, "[rad/s]")
      .def_prop_ro(
          "rows", [](const Reach& r) { return choice_name(r.rows, kReachRows); },
          "'both' in one level, or 'position' or 'orientation' alone.");
  nb::class_<JointLimits>(m, "JointLimits", "Keep every joint off its position limits.")
      .def(
          "__init__",
          [](JointLimits* self, double gain, double margin) {
            construct(self, {gain, margin});
          },
          nb::kw_only(), "gain"_a = JointLimits{}.gain, "margin"_a = JointLimits{}.margin, raises)
      .def_rw("gain", &JointLimits::gain, "[1/s] towards the middle of the range.")
      .def_rw("margin", &JointLimits::margin, "[rad] or [m] from a limit, where it begins to act.");
  nb::class_<MinimumAltitude>(m, "MinimumAltitude",
                              "Keep the tool above a height. Source: thesis 4.2.1.1.")
      .def(
          "__init__",
          [](MinimumAltitude* self, double height, double buffer, double gain) {
            construct(self, {height, buffer, gain});
          },
          nb::kw_only(), "height"_a = MinimumAltitude{}.height,
          "buffer"_a = MinimumAltitude{}.buffer, "gain"_a = MinimumAltitude{}.gain, raises)
      .def_rw("height", &MinimumAltitude::height, "[m] in world.")
      .def_rw("buffer", &MinimumAltitude::buffer, "[m] above it, where it begins to act.")
      .def_rw("gain", &MinimumAltitude::gain, "[1/s]");
  nb::class_<Manipulability>(
      m, "Manipulability",
      "Keep one arm's manipulability sqrt(det(J J')) up; needs at least 6 joints.")
      .def(
          "__init__",
          [](Manipulability* self, double target, double low, double high, double gain,
             int first_joint, int joints, double unit) {
            construct(self, {target, low, high, gain, first_joint, joints, unit});
          },
          nb::kw_only(), "target"_a = Manipulability{}.target, "low"_a = Manipulability{}.low,
          "high"_a = Manipulability{}.high, "gain"_a = Manipulability{}.gain,
          "first_joint"_a = Manipulability{}.first_joint, "joints"_a = Manipulability{}.joints,
          "unit"_a = Manipulability{}.unit, raises)
      .def_rw("target", &Manipulability::target, "[-] the rate pulls towards it.")
      .def_rw("low", &Manipulability::low, "[-] fully active below.")
      .def_rw("high", &Manipulability::high, "[-] inactive above.")
      .def_rw("gain", &Manipulability::gain, "[1/s]")
      .def_rw("first_joint", &Manipulability::first_joint, "Of the arm that is meant.")
      .def_rw("joints", &Manipulability::joints, "Of that arm; 0 takes all from first_joint on.")
      .def_rw("unit", &Manipulability::unit, "It is counted in this: 1, or the arm's maximum.");
  nb::class_<SelfCollision>(m, "SelfCollision",
                            "Keep links off one another, as avoidance does off obstacles.")
      .def(
          "__init__",
          [](SelfCollision* self, double d_min, double buffer, double gain, int nearest,
             const std::vector<std::pair<std::string, std::string>>& pairs) {
            construct(self, {d_min, buffer, gain, nearest, pairs});
          },
          nb::kw_only(), "d_min"_a = SelfCollision{}.d_min, "buffer"_a = SelfCollision{}.buffer,
          "gain"_a = SelfCollision{}.gain, "nearest"_a = SelfCollision{}.nearest,
          "pairs"_a = SelfCollision{}.pairs, raises)
      .def_rw("d_min", &SelfCollision::d_min, "[m] distance to keep.")
      .def_rw("buffer", &SelfCollision::buffer, "[m] the activation rises from 0 to 1 inside it.")
      .def_rw("gain", &SelfCollision::gain, "[1/s]")
      .def_rw("nearest", &SelfCollision::nearest, "This many nearest pairs, one row each.")
      .def_rw("pairs", &SelfCollision::pairs,
              "Names of the links that are watched, two and two; empty: all that more than one "
              "joint moves apart.");
  m.def("decreasing", &decreasing, "x"_a, "a"_a, "b"_a,
        "Bell of [iCAT]: 1 for x <= a, 0 for x >= b, a cosine between.");
  m.def("increasing", &increasing, "x"_a, "a"_a, "b"_a, "1 - decreasing.");
}

}  // namespace proxcgal::binding
