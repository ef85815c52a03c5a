#pragma once
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "named_pair.hpp"
#include "proxcgal/control/controller.hpp"

/// What a tick tells, as Python keeps it: links by name, nothing that the next tick writes over.
namespace proxcgal::binding {

/// A finding that tells its link by name.
struct NamedFinding {
  Finding finding;
  std::optional<std::string> link;
};

/// A kept tick whose findings tell their links by name.
struct NamedRecord {
  TickRecord record;
  std::string link;
  std::vector<NamedFinding> findings;
};

struct Report {
  std::string name;
  Eigen::VectorXd rate, activation, residual;
};

/// A row of the limit stage with the name of its link, or joint.
struct NamedLimit {
  ActiveLimit row;
  std::string link;
};

/// A tick's output that a user may keep: the core's own is reused.
struct Output {
  Eigen::VectorXd nominal_qd, qd;
  std::vector<NamedLimit> limited;
  std::optional<NamedPair> pair;
  PointOrigin origin;
  double pair_age = 0.0;
  bool pair_remembered = false;
  Vector3 obstacle_velocity_W = Vector3::Zero();
  std::optional<Vector3> control_W;
  double control_distance = kInfinity;
  std::string control_link;
  std::optional<std::pair<std::string, std::string>> own_links;
  double own_distance = kInfinity;
  double trusted_distance = kInfinity;
  Mode mode;
  std::vector<NamedFinding> findings;
  std::vector<Report> tasks;
  std::map<std::string, double> timings;
};

Output kept(const Controller& controller, const TickOutput& out);
std::vector<NamedRecord> last_ticks(const Controller& controller);

}  // namespace proxcgal::binding
