#pragma once
#include <algorithm>
#include <array>
#include <vector>

#include "proxcgal/control/tick_output.hpp"

namespace proxcgal::detail {

/// The last ticks, for whoever asks why the arm stopped: those before a STOP stay until it is left.
class TickHistory {
 public:
  /// @param q  as it came: of the right size or not
  void add(double time, const JointVector& q, Eigen::Index n_q, const TickOutput& out,
           std::span<const Finding> findings) {
    if (stopped_) return;
    TickRecord& record = kept_[count_++ % kKeptTicks];
    record.time = time;
    record.mode = out.mode;
    record.q = q.size() == n_q ? q : JointVector::Constant(n_q, kInfinity);
    record.qd = out.qd;
    record.distance = out.pair_distance();
    record.link = out.pair ? out.pair->link : -1;
    record.origin = out.pair_origin;
    record.n_findings = static_cast<int>(findings.size());
    const auto first = findings.first(std::min(findings.size(), record.findings.size()));
    std::copy(first.begin(), first.end(), record.findings.begin());
    stopped_ = out.mode == Mode::kStop;
  }
  void go_on() { stopped_ = false; }

  /// The oldest first.
  std::vector<TickRecord> records() const {
    std::vector<TickRecord> records;
    for (std::size_t back = std::min<std::size_t>(count_, kKeptTicks); back > 0; --back)
      records.push_back(kept_[(count_ - back) % kKeptTicks]);
    return records;
  }

 private:
  std::array<TickRecord, kKeptTicks> kept_;
  std::size_t count_ = 0;  // ever added
  bool stopped_ = false;
};

}  // namespace proxcgal::detail
