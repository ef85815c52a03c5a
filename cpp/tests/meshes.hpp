#pragma once
#include <cmath>
#include <random>

#include "proxcgal/types.hpp"

/// Small meshes of our own for the C++ tests.
namespace proxcgal::test {

struct Mesh {
  Points vertices;
  Triangles triangles;
};

/// A sphere of rings and segments with a wave on it: neither convex nor symmetric.
inline Mesh bumpy_sphere(int rings, int segments, double radius = 0.2, double wave = 0.03) {
  Mesh mesh;
  mesh.vertices.resize((rings + 1) * segments, 3);
  mesh.triangles.resize(2 * rings * segments, 3);
  int f = 0;
  for (int i = 0; i <= rings; ++i) {
    for (int j = 0; j < segments; ++j) {
      const double theta = M_PI * i / rings, phi = 2 * M_PI * j / segments;
      const double r = radius + wave * std::sin(5 * theta) * std::cos(3 * phi + 0.3);
      mesh.vertices.row(i * segments + j) << r * std::sin(theta) * std::cos(phi),
          r * std::sin(theta) * std::sin(phi), r * std::cos(theta);
      if (i == rings) continue;
      const int a = i * segments + j, b = i * segments + (j + 1) % segments;
      mesh.triangles.row(f++) << a, a + segments, b;
      mesh.triangles.row(f++) << b, a + segments, b + segments;
    }
  }
  return mesh;
}

inline Mesh box(const Vector3& size) {
  Mesh mesh;
  mesh.vertices.resize(8, 3);
  for (int i = 0; i < 8; ++i) {
    mesh.vertices.row(i) << ((i & 1) != 0 ? 0.5 : -0.5) * size.x(),
        ((i & 2) != 0 ? 0.5 : -0.5) * size.y(), ((i & 4) != 0 ? 0.5 : -0.5) * size.z();
  }
  mesh.triangles.resize(12, 3);
  mesh.triangles << 0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2,
      2, 4, 6, 1, 3, 5, 3, 7, 5;
  return mesh;
}

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  Vector3 vector(double half) {
    return {uniform(-half, half), uniform(-half, half), uniform(-half, half)};
  }
  Pose pose(double half) {
    Pose T = Pose::Identity();
    T.linear() = Eigen::Quaterniond(
                     Eigen::Vector4d(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(-1, 1))
                         .normalized())
                     .toRotationMatrix();
    T.translation() = vector(half);
    return T;
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace proxcgal::test
