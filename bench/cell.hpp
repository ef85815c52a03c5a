#pragma once
#include <memory>
#include <string>
#include <vector>

#include "proxcgal/control/controller.hpp"

/// One cell of the timing grid, as bench/inputs.py writes it.
namespace proxcgal::bench {

struct Cell {
  std::string name;  ///< of the file
  std::shared_ptr<Robot> robot;
  Posture posture;
  Pose goal;
  Skin skin;
  std::vector<Scan> scans;
  Points origins_W, points_W;  ///< Algorithm 1
  std::vector<double> tolerance;
  double min_hit = 0.0;
  std::vector<std::uint8_t> kept;  ///< by the literal algorithm
  Points environment_W;            ///< Algorithm 2
  double distance = 0.0;           ///< by the literal algorithm

  int vertices() const;  ///< of the largest link
};

/// @throws std::runtime_error  what of the file is not as it should be
Cell read_cell(const std::string& path);

}  // namespace proxcgal::bench
