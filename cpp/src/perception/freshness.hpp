#pragma once
#include <array>
#include <vector>

#include "proxcgal/pipeline/sense.hpp"
#include "proxcgal/safety/monitor.hpp"

namespace proxcgal::detail {

/// What is to be thought of each sensor's packets: new or repeated, how old, believable or not.
class Freshness {
 public:
  Freshness(const Skin& skin, const MonitorConfig& config);

  /// Is it a packet of this skin, newer than the last, with a stamp that can be? Else that is told.
  /// @param time   internal clock [s]
  /// @param delay  internal time minus the caller's
  bool accept(double time, double delay, const Scan& scan, Monitor& monitor);
  /// An accepted packet. @param targets  zones that saw something, however far
  void note(double time, const Scan& scan, int targets, bool usable);
  /// Tells silent and suspect sensors, silent arrays and a silent skin.
  void check(double time, Monitor& monitor) const;

  double age(std::size_t sensor, double time) const;  ///< [s] since the last usable packet
  /// [s] since the sensor last told anything that can be believed.
  double blind_for(std::size_t sensor, double time) const;
  /// The same payload again and again: it is not what the sensor sees.
  bool suspect(std::size_t sensor) const { return suspect(packets_[sensor]); }
  std::size_t sensors() const { return packets_.size(); }

 private:
  struct Packets {
    bool counted = false;  // one came, usable or not
    bool seen = false;     // a usable one came
    std::uint32_t counter = 0;
    double received = 0.0;
    int repeats = 0;  // equal payloads in a row
    std::array<double, kZones> ranges{};
    std::array<std::uint8_t, kZones> status{};
  };
  bool suspect(const Packets& packets) const {
    return config_.suspect_repeats > 0 && packets.repeats >= config_.suspect_repeats;
  }
  void check_arrays(double time, Monitor& monitor) const;

  MonitorConfig config_;
  std::vector<Packets> packets_;
  std::vector<std::vector<std::size_t>> arrays_;  // the sensors of each array of more than one
};

}  // namespace proxcgal::detail
