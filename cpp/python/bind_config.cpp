#include <nanobind/stl/variant.h>

#include "convert.hpp"
#include "named_pair.hpp"
#include "proxcgal/control/controller.hpp"
#include "topics.hpp"

namespace proxcgal::binding {
namespace {

constexpr std::pair<const char*, ControlPoint> kControlPoints[] = {
    {"whole_body", ControlPoint::kWholeBody}, {"sensor", ControlPoint::kSensor}};
constexpr std::pair<const char*, Confirmation> kConfirmations[] = {
    {"off", Confirmation::kOff}, {"zones", Confirmation::kZones}, {"scans", Confirmation::kScans}};

}  // namespace

void bind_config(nb::module_& m) {
  nb::class_<FilterConfig>(
      m, "FilterConfig",
      "How the robot's own body is told from obstacles ([WA] Algorithm 1, and what noise adds).")
      .def(
          "__init__",
          [](FilterConfig* self, double tolerance, double sigmas, double min_hit,
             bool surface_margin, const std::string& confirmation, double z_min) {
            const FilterConfig config{tolerance,
                                      sigmas,
                                      min_hit,
                                      surface_margin,
                                      choice(confirmation, "confirmation", kConfirmations),
                                      z_min};
            config.validate();
            new (self) FilterConfig(config);
          },
          nb::kw_only(), "tolerance"_a = FilterConfig{}.tolerance,
          "sigmas"_a = FilterConfig{}.sigmas, "min_hit"_a = FilterConfig{}.min_hit,
          "surface_margin"_a = FilterConfig{}.surface_margin, "confirmation"_a = "off",
          "z_min"_a = FilterConfig{}.z_min)
      .def_ro("tolerance", &FilterConfig::tolerance, "[m] epsilon of Algorithm 1.")
      .def_ro("sigmas", &FilterConfig::sigmas, "The tolerance is at least this many sigma(range).")
      .def_ro("min_hit", &FilterConfig::min_hit, "[m] nearer hits are the sensor's own mounting.")
      .def_ro("surface_margin", &FilterConfig::surface_margin,
              "Also drop what lies that near to any link's surface.")
      .def_prop_ro(
          "confirmation",
          [](const FilterConfig& c) { return choice_name(c.confirmation, kConfirmations); },
          "'off', 'zones' or 'scans'.")
      .def_ro("z_min", &FilterConfig::z_min, "[m] world height below which points are cropped.");
  nb::class_<MonitorConfig>(m, "MonitorConfig", "Bounds of the monitor.")
      .def(
          "__init__",
          [](MonitorConfig* self, double degraded_after, double hold_after, double degraded_scale,
             int clean_cycles, int missed_deadlines, int suspect_repeats, double fresh_within,
             double approach_speed, double blind_speed, double joints_hold_after,
             double joints_stop_after, double stuck_after, bool await_mounts) {
            const MonitorConfig config{
                degraded_after,    hold_after,   degraded_scale, clean_cycles, missed_deadlines,
                suspect_repeats,   fresh_within, approach_speed, blind_speed,  joints_hold_after,
                joints_stop_after, stuck_after,  await_mounts};
            config.validate();
            new (self) MonitorConfig(config);
          },
          nb::kw_only(), "degraded_after"_a = MonitorConfig{}.degraded_after,
          "hold_after"_a = MonitorConfig{}.hold_after,
          "degraded_scale"_a = MonitorConfig{}.degraded_scale,
          "clean_cycles"_a = MonitorConfig{}.clean_cycles,
          "missed_deadlines"_a = MonitorConfig{}.missed_deadlines,
          "suspect_repeats"_a = MonitorConfig{}.suspect_repeats,
          "fresh_within"_a = MonitorConfig{}.fresh_within,
          "approach_speed"_a = MonitorConfig{}.approach_speed,
          "blind_speed"_a = MonitorConfig{}.blind_speed,
          "joints_hold_after"_a = MonitorConfig{}.joints_hold_after,
          "joints_stop_after"_a = MonitorConfig{}.joints_stop_after,
          "stuck_after"_a = MonitorConfig{}.stuck_after,
          "await_mounts"_a = MonitorConfig{}.await_mounts)
      .def_ro("degraded_after", &MonitorConfig::degraded_after,
              "[s] age at which one silent sensor degrades the mode.")
      .def_ro("hold_after", &MonitorConfig::hold_after,
              "[s] age at which the silence of an array holds the arm.")
      .def_ro("degraded_scale", &MonitorConfig::degraded_scale,
              "[-] of the speed limits while degraded.")
      .def_ro("clean_cycles", &MonitorConfig::clean_cycles,
              "Cycles without a cause before HOLD or DEGRADED clears.")
      .def_ro("missed_deadlines", &MonitorConfig::missed_deadlines, "In a row, before HOLD.")
      .def_ro("suspect_repeats", &MonitorConfig::suspect_repeats,
              "Equal payloads in a row that make a sensor suspect, 0 for never.")
      .def_ro("fresh_within", &MonitorConfig::fresh_within,
              "[s] a scan of this age is trusted as it is.")
      .def_ro("approach_speed", &MonitorConfig::approach_speed,
              "[m/s] assumed of what moves in: shortens the trusted distance past fresh_within.")
      .def_ro("blind_speed", &MonitorConfig::blind_speed,
              "[m/s] at most into what a silent sensor covered; 0 at hold_after.")
      .def_ro("joints_hold_after", &MonitorConfig::joints_hold_after,
              "[s] age of the joint state that holds the arm.")
      .def_ro("joints_stop_after", &MonitorConfig::joints_stop_after,
              "[s] age of the joint state that stops it.")
      .def_ro("stuck_after", &MonitorConfig::stuck_after,
              "[s] of avoidance not executed inside d_min, before HOLD.")
      .def_ro("await_mounts", &MonitorConfig::await_mounts,
              "HOLD until Controller.accept_mounts() says that the mounts were checked.");
  nb::class_<MemoryConfig>(m, "MemoryConfig",
                           "What is remembered of what left the sensors' view; ours, not [WA]'s.")
      .def(
          "__init__",
          [](MemoryConfig* self, double memory_s, double voxel, int max_points, int clear_scans) {
            const MemoryConfig config{memory_s, voxel, max_points, clear_scans};
            config.validate();
            new (self) MemoryConfig(config);
          },
          nb::kw_only(), "memory_s"_a = MemoryConfig{}.memory_s, "voxel"_a = MemoryConfig{}.voxel,
          "max_points"_a = MemoryConfig{}.max_points, "clear_scans"_a = MemoryConfig{}.clear_scans)
      .def_ro("memory_s", &MemoryConfig::memory_s,
              "[s] age at which a point is forgotten in any case; 0: none is kept.")
      .def_ro("voxel", &MemoryConfig::voxel, "[m] edge; each holds one point, the newest.")
      .def_ro("max_points", &MemoryConfig::max_points,
              "Beyond, those farthest from the arm are forgotten.")
      .def_ro("clear_scans", &MemoryConfig::clear_scans,
              "Scans that must see through a point before it counts as gone.");
  nb::class_<MotionConfig>(
      m, "MotionConfig",
      "How the closest obstacle's velocity is estimated, the x_o of [WA] eq. (4); ours.")
      .def(
          "__init__",
          [](MotionConfig* self, double window, double radius, double confidence,
             double max_speed) {
            const MotionConfig config{window, radius, confidence, max_speed};
            config.validate();
            new (self) MotionConfig(config);
          },
          nb::kw_only(), "window"_a = MotionConfig{}.window, "radius"_a = MotionConfig{}.radius,
          "confidence"_a = MotionConfig{}.confidence, "max_speed"_a = MotionConfig{}.max_speed)
      .def_ro("window", &MotionConfig::window, "[s] scans that old count.")
      .def_ro("radius", &MotionConfig::radius,
              "[m] of the patch of surface round the closest point.")
      .def_ro("confidence", &MotionConfig::confidence,
              "Standard deviations below which a velocity is taken for none.")
      .def_ro("max_speed", &MotionConfig::max_speed, "[m/s] the estimate is shortened to it.");
  nb::class_<ControllerConfig>(
      m, "ControllerConfig",
      "Everything the controller is set up with; `tasks` in order of priority.")
      .def(
          "__init__",
          [](ControllerConfig* self, const std::string& control_point,
             const std::optional<std::vector<TaskSpec>>& tasks, const FilterConfig& filter,
             const SolverConfig& solver, const MonitorConfig& monitor, double period,
             double min_row_norm, std::vector<std::string> avoid_links, const std::string& method,
             int max_points, bool timings, std::optional<MemoryConfig> memory,
             std::optional<MotionConfig> motion) {
            const ControllerConfig config{choice(control_point, "control_point", kControlPoints),
                                          tasks ? *tasks : ControllerConfig{}.tasks,
                                          filter,
                                          solver,
                                          monitor,
                                          period,
                                          min_row_norm,
                                          std::move(avoid_links),
                                          choice(method, "method", kMethods),
                                          max_points,
                                          timings,
                                          memory,
                                          motion};
            config.validate();
            new (self) ControllerConfig(config);
          },
          "control_point"_a = "whole_body", "tasks"_a = nb::none(), nb::kw_only(),
          "filter"_a = FilterConfig{}, "solver"_a = SolverConfig{}, "monitor"_a = MonitorConfig{},
          "period"_a = ControllerConfig{}.period,
          "min_row_norm"_a = ControllerConfig{}.min_row_norm,
          "avoid_links"_a = std::vector<std::string>{}, "method"_a = "fast",
          "max_points"_a = ControllerConfig{}.max_points, "timings"_a = false,
          "memory"_a = nb::none(), "motion"_a = nb::none())
      .def_prop_ro(
          "control_point",
          [](const ControllerConfig& c) { return choice_name(c.control_point, kControlPoints); },
          "'whole_body', or 'sensor' (SM).")
      .def_ro("tasks", &ControllerConfig::tasks, "The most important first.")
      .def_ro("filter", &ControllerConfig::filter, "How the body is told from obstacles.")
      .def_ro("solver", &ControllerConfig::solver, "Constants of the pseudo-inverse.")
      .def_ro("monitor", &ControllerConfig::monitor, "Bounds of the monitor.")
      .def_ro("period", &ControllerConfig::period, "[s] nominal time from tick to tick.")
      .def_ro("min_row_norm", &ControllerConfig::min_row_norm,
              "A link whose row n'J is smaller is passed over.")
      .def_ro("avoid_links", &ControllerConfig::avoid_links,
              "Links that avoidance looks at; empty for all that some joint moves.")
      .def_prop_ro(
          "method", [](const ControllerConfig& c) { return choice_name(c.method, kMethods); },
          "'fast', or 'paper' for the literal algorithms.")
      .def_ro("max_points", &ControllerConfig::max_points,
              "The most known points that a tick takes.")
      .def_ro("timings", &ControllerConfig::timings, "Whether a tick tells what each stage took.")
      .def_ro("memory", &ControllerConfig::memory,
              "Of what left the sensors' view; None: as in the paper.")
      .def_ro("motion", &ControllerConfig::motion,
              "x_o of eq. (4) from the scans; None: taken for zero.");
}

}  // namespace proxcgal::binding
