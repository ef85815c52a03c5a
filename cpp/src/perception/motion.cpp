#include "proxcgal/perception/motion.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <vector>

namespace proxcgal {
namespace {

constexpr int kMostPoints = 160;        // of a patch: bounded work
constexpr int kRounds = 3;              // of reweighting
constexpr int kFewest = 6;              // points: what they can't tell of nine unknowns priors do
constexpr double kFresh = 0.10;         // [s] a patch that was not seen since has no velocity
constexpr double kLeastBaseline = 0.1;  // [s] between its first and its last scan: three at 15 Hz
constexpr double kMoved = 0.02;         // [m] of the anchor, from where on it is asked anew
constexpr double kNoise = 0.008;        // [m] of a range, as likely before any residual was seen
constexpr double kNoiseWeight = 10.0;   // residuals that this is worth: few points tell it badly
constexpr double kFastest = 0.5;        // [m/s] the spread of velocities that is taken for likely
constexpr double kSteepest = 0.3;       // [-] likely slope against the patch's own plane
constexpr double kMostCurved = 4.0;     // [1/m] likely half curvature: a body of 0.125 m radius
constexpr double kOutlier = 2.5;        // standard deviations from where on a point counts less

using Matrix9 = Eigen::Matrix<double, 9, 9>;
using Vector9 = Eigen::Matrix<double, 9, 1>;

/// By how much a variance that was told by few residuals is to be taken for more, so that a bound
/// of so many standard deviations is as sure: squared quantile of Student's t over the normal's
/// (Gaver and Kafadar, A Retrievable Recipe for Inverse t, The American Statistician 38, 1984).
/// @param free  degrees of freedom, well above 1
double widened(double deviations, double free) {
  const double squared = deviations * deviations;
  if (!(squared > 0.0)) return 1.0;
  return free * std::expm1(squared * (free - 1.5) / ((free - 1.0) * (free - 1.0))) / squared;
}

}  // namespace

struct Motion::Impl {
  MotionConfig config;
  /// One scan's points in single precision, and the box round them.
  struct Batch {
    double stamp = -kInfinity;  // [s]
    int count = 0;
    std::array<float, kZones> x{}, y{}, z{};
    Eigen::Vector3f low, high;
  };
  std::vector<Batch> batches;  // the oldest is overwritten first
  std::size_t next = 0;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> near;  // batch and row, the newest first
  bool changed = false;

  Vector3 anchor_W = Vector3::Constant(kInfinity);
  Vector3 velocity_W = Vector3::Zero();
  double newest = -kInfinity;  // [s] of the patch that it is of

  struct Patch {
    int n = 0;
    std::array<Vector3, kMostPoints> point;  // from the anchor
    std::array<double, kMostPoints> time;    // [s] from now, 0 or less
    std::array<double, kMostPoints> weight;
  } patch;

  Impl(const MotionConfig& c, std::size_t sensors) : config(c) {
    // The window at 15 Hz and a scan to spare.
    const auto scans = static_cast<std::size_t>(std::ceil(config.window * 15.0) + 1.0);
    batches.resize(std::clamp<std::size_t>(sensors, 1, 256) * scans);
    near.resize(batches.size() * kZones);
  }

  void fill(double time, const Vector3& velocity, double age);
  Eigen::Matrix3d axes(const Vector3& velocity, const Vector3& mean) const;
  bool fit(Vector3& velocity, Eigen::Matrix3d& covariance);
  Vector3 estimate(double time);
};

/// The points within `radius` of where the anchor was at their time, if it moved so.
/// @param age  [s] of the oldest that count
void Motion::Impl::fill(double time, const Vector3& velocity, double age) {
  patch.n = 0;
  const auto radius = static_cast<float>(config.radius);
  std::size_t found = 0;
  for (std::size_t back = 1; back <= batches.size(); ++back) {
    const std::size_t at = (next + batches.size() - back) % batches.size();
    const Batch& batch = batches[at];
    if (!(time - batch.stamp <= age)) continue;  // one sensor may be late: not all behind it are
    const Eigen::Vector3f c = (anchor_W + velocity * (batch.stamp - time)).cast<float>();
    if (!((c - c.cwiseMax(batch.low).cwiseMin(batch.high)).squaredNorm() <= radius * radius))
      continue;
    for (int i = 0; i < batch.count; ++i) {
      const auto row = static_cast<std::size_t>(i);
      const float dx = batch.x[row] - c.x(), dy = batch.y[row] - c.y(), dz = batch.z[row] - c.z();
      if (dx * dx + dy * dy + dz * dz <= radius * radius)
        near[found++] = {static_cast<std::uint32_t>(at), static_cast<std::uint32_t>(i)};
    }
  }
  // Every so many, the newest first, so that no scan is left out.
  const std::size_t stride = (found + kMostPoints - 1) / kMostPoints;
  for (std::size_t i = 0; i < found; i += stride) {
    const Batch& batch = batches[near[i].first];
    const std::size_t row = near[i].second;
    const auto to = static_cast<std::size_t>(patch.n++);
    patch.point[to] = Vector3(batch.x[row], batch.y[row], batch.z[row]) - anchor_W;
    patch.time[to] = batch.stamp - time;
    patch.weight[to] = 1.0;
  }
}

/// Axes of the patch, its normal first, about its mean, as it would be if it moved so.
///
/// Its shape is what is left of the spread once the drift of the middle is taken out: three places
/// of a small body, one behind the other, would pass for a patch that stands along its way.
Eigen::Matrix3d Motion::Impl::axes(const Vector3& velocity, const Vector3& mean) const {
  double middle = 0.0;
  for (int i = 0; i < patch.n; ++i) middle += patch.time[static_cast<std::size_t>(i)] / patch.n;
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  Vector3 drift = Vector3::Zero();
  double lasted = 0.0;
  for (int i = 0; i < patch.n; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const Vector3 d = patch.point[at] - velocity * patch.time[at] - mean;
    const double t = patch.time[at] - middle;
    spread += d * d.transpose();
    drift += t * d;
    lasted += t * t;
  }
  if (lasted > 0.0) spread -= drift * drift.transpose() / lasted;
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> found;
  found.computeDirect(spread);
  return found.eigenvectors();
}

/// A smooth patch h = f(u, w) that moves as a whole, by least squares:
///   n'(p - v t) = c0 + c1 u + c2 w + c3 u^2 + c4 u w + c5 w^2,   u, w of p - v t.
/// Linearised in v, so that a surface that is flat shows its normal velocity only; a weak prior
/// keeps what cannot be seen at zero.
/// @param covariance  of the velocity, as wide as Student's t makes it where few points tell the
///                    noise: `confidence` standard deviations of it are as unlikely as of a normal
bool Motion::Impl::fit(Vector3& velocity, Eigen::Matrix3d& covariance) {
  const int n = patch.n;
  if (n < kFewest) return false;
  Vector3 mean = Vector3::Zero();
  for (int i = 0; i < n; ++i) {
    const auto at = static_cast<std::size_t>(i);
    mean += (patch.point[at] - velocity * patch.time[at]) / n;
  }
  const Eigen::Matrix3d R = axes(velocity, mean);
  const Vector3 normal = R.col(0), e_u = R.col(1), e_w = R.col(2);
  double sigma = kNoise, free = kNoiseWeight;  // degrees of freedom that sigma rests on
  double fitted = 9.0;                         // unknowns that the points tell, not the priors
  Vector9 x9 = Vector9::Zero();
  for (int round = 0; round < kRounds; ++round) {
    Matrix9 A = Matrix9::Zero();
    Vector9 b = Vector9::Zero();
    double squares = 0.0, weights = 0.0;
    for (int i = 0; i < n; ++i) {
      const auto at = static_cast<std::size_t>(i);
      const double t = patch.time[at];
      const Vector3 q = patch.point[at] - velocity * t - mean;
      const double u = e_u.dot(q), w = e_w.dot(q), h = normal.dot(q);
      const Vector3 slope = normal - (x9[1] + 2.0 * x9[3] * u + x9[4] * w) * e_u -
                            (x9[2] + x9[4] * u + 2.0 * x9[5] * w) * e_w;
      Vector9 row;
      row << 1.0, u, w, u * u, u * w, w * w, t * slope;
      const double surface = row.head<6>().dot(x9.head<6>());
      const double r = h - surface;
      if (round > 0) {
        const double beyond = std::abs(r) / (kOutlier * sigma);
        patch.weight[at] = beyond > 1.0 ? 1.0 / (beyond * beyond) : 1.0;
      }
      const double weight = patch.weight[at];
      squares += weight * r * r;
      weights += weight;
      A.noalias() += (weight * row) * row.transpose();
      b += weight * h * row;
    }
    if (round > 0) {
      free = kNoiseWeight + std::max(weights - fitted, 0.0);
      sigma = std::sqrt((kNoiseWeight * kNoise * kNoise + squares) / free);
    }
    // The prior is on the velocity itself, not on the step.
    const double noise = sigma * sigma;
    Vector9 prior;
    prior << 1e-9, Eigen::Vector2d::Constant(noise / (kSteepest * kSteepest)),
        Vector3::Constant(noise / (kMostCurved * kMostCurved)),
        Vector3::Constant(noise / (kFastest * kFastest));
    A.diagonal() += prior;
    b.tail<3>() -= prior.tail<3>().cwiseProduct(velocity);
    const Eigen::LDLT<Matrix9> solved(A);
    if (solved.info() != Eigen::Success) return false;
    x9 = solved.solve(b);
    const Matrix9 inverse = solved.solve(Matrix9::Identity());
    fitted = 9.0 - inverse.diagonal().dot(prior);
    velocity += x9.tail<3>();
    if (!velocity.allFinite() || velocity.norm() > 10.0) return false;
    covariance = noise * inverse.bottomRightCorner<3, 3>();
  }
  covariance *= widened(config.confidence, free);
  return true;
}

Vector3 Motion::Impl::estimate(double time) {
  Vector3 velocity = Vector3::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  bool fitted = false;
  newest = -kInfinity;
  // From the last two scans to the whole window: where the patch was before is told by how it
  // moves.
  for (const double share : {0.5, 1.0}) {
    fill(time, velocity, share * config.window + kFresh * (1.0 - share));
    if (patch.n == 0) return Vector3::Zero();
    newest = time + patch.time[0];
    const double first = patch.time[static_cast<std::size_t>(patch.n - 1)];
    fitted = patch.time[0] - first > 0.03 && fit(velocity, covariance);
    if (!fitted) velocity.setZero();
  }
  const double first = patch.time[static_cast<std::size_t>(patch.n - 1)];
  if (!fitted || patch.time[0] - first < kLeastBaseline) return Vector3::Zero();
  // What cannot be told from noise is none; what hardly can is shortened.
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes;
  axes.computeDirect(0.5 * (covariance + covariance.transpose()));
  Vector3 kept = Vector3::Zero();
  for (int k = 0; k < 3; ++k) {
    const double part = axes.eigenvectors().col(k).dot(velocity);
    const double noise =
        config.confidence * config.confidence * std::max(axes.eigenvalues()[k], 0.0);
    const double share = noise / (part * part);
    if (part * part > noise) kept += part * (1.0 - share * share) * axes.eigenvectors().col(k);
  }
  const double speed = kept.norm();
  return speed > config.max_speed ? Vector3(kept * (config.max_speed / speed)) : kept;
}

Motion::Motion(const MotionConfig& config, std::size_t sensors)
    : impl_(std::make_unique<Impl>(config, sensors)) {}
Motion::~Motion() = default;
Motion::Motion(Motion&&) noexcept = default;

void Motion::see(double stamp, std::span<const Vector3> points_W) {
  Impl& me = *impl_;
  for (std::size_t begin = 0; begin < points_W.size(); begin += kZones) {
    Impl::Batch& batch = me.batches[me.next];
    me.next = (me.next + 1) % me.batches.size();
    batch.stamp = stamp;
    batch.count = static_cast<int>(std::min<std::size_t>(kZones, points_W.size() - begin));
    batch.low.setConstant(INFINITY);
    batch.high.setConstant(-INFINITY);
    for (int i = 0; i < batch.count; ++i) {
      const auto row = static_cast<std::size_t>(i);
      const Eigen::Vector3f p = points_W[begin + row].cast<float>();
      batch.x[row] = p.x();
      batch.y[row] = p.y();
      batch.z[row] = p.z();
      batch.low = batch.low.cwiseMin(p);
      batch.high = batch.high.cwiseMax(p);
    }
  }
  me.changed = true;
}

Vector3 Motion::velocity_W(double time, const Vector3& anchor_W) {
  Impl& me = *impl_;
  if (me.changed || !((anchor_W - me.anchor_W).norm() < kMoved)) {
    me.anchor_W = anchor_W;
    me.velocity_W = me.estimate(time);
    me.changed = false;
  }
  return time - me.newest <= kFresh ? me.velocity_W : Vector3(Vector3::Zero());
}

}  // namespace proxcgal
