#pragma once
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "proxcgal/fields.hpp"
#include "proxcgal/perception/memory.hpp"
#include "proxcgal/perception/motion.hpp"
#include "proxcgal/pipeline/filter.hpp"
#include "proxcgal/pipeline/limit_config.hpp"
#include "proxcgal/pipeline/sense.hpp"
#include "proxcgal/pipeline/solve.hpp"
#include "proxcgal/pipeline/task_config.hpp"
#include "proxcgal/safety/monitor.hpp"

namespace proxcgal {

/// What the avoidance task moves.
enum class ControlPoint : std::uint8_t {
  kWholeBody,  ///< the surface point nearest to the cloud, any link
  kSensor,     ///< the mounting point of the sensor nearest to the cloud (SM baseline)
};

template <>
inline constexpr auto choices<ControlPoint> = std::array{
    Choice{"whole_body", ControlPoint::kWholeBody}, Choice{"sensor", ControlPoint::kSensor}};

struct ControllerConfig {
  ControlPoint control_point = ControlPoint::kWholeBody;
  std::vector<TaskSpec> tasks = {Avoidance{}, Reach{}};
  FilterConfig filter;
  SolverConfig solver;
  LimitConfig limit;
  MonitorConfig monitor;
  double period = 0.01;
  double min_row_norm = 0.05;
  std::vector<std::string> avoid_links;
  Method method = Method::kFast;
  int max_points = 200000;
  bool timings = false;
  std::optional<MemoryConfig> memory;
  std::optional<MotionConfig> motion;
};

template <>
inline constexpr auto fields<ControllerConfig> = field_table(
    "ControllerConfig", "Set-up of the controller; `tasks` in order of priority.",
    field(&ControllerConfig::control_point, "control_point",
          "Point that avoidance moves: the surface point nearest to the cloud, or the mounting "
          "point of the sensor nearest to it (the SM baseline)."),
    field(&ControllerConfig::tasks, "tasks", "", between(1, kMaxLevels),
          "Tasks, the most important first."),
    field(&ControllerConfig::filter, "filter", "How the body is told from obstacles."),
    field(&ControllerConfig::solver, "solver", "Constants of the pseudo-inverse."),
    field(&ControllerConfig::limit, "limit", "The stage after the solver."),
    field(&ControllerConfig::monitor, "monitor", "Bounds of the monitor."),
    field(&ControllerConfig::period, "period", "s", above(0).at_most(0.5),
          "Nominal time from tick to tick."),
    field(&ControllerConfig::min_row_norm, "min_row_norm", "", at_least(0).below(1),
          "A link whose row n'J has a smaller norm is passed over."),
    field(&ControllerConfig::avoid_links, "avoid_links",
          "Links to keep away from obstacles; empty: all that some joint moves."),
    field(&ControllerConfig::method, "method",
          "Accelerated algorithms, or the literal ones; both give the same answer."),
    field(&ControllerConfig::max_points, "max_points", "", at_least(1),
          "Largest number of known points that a tick takes."),
    field(&ControllerConfig::timings, "timings", "Measure how long each stage of a tick takes."),
    field(&ControllerConfig::memory, "memory",
          "Memory of points that left the sensors' view; none: as in the paper."),
    field(&ControllerConfig::motion, "motion",
          "Estimate of x_o of eq. (4) from the scans; none: taken as zero."));
void check(const ControllerConfig& config, const std::string& path);

}  // namespace proxcgal
