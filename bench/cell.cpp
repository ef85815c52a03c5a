#include "cell.hpp"

#include <filesystem>
#include <fstream>
#include <stdexcept>

namespace proxcgal::bench {
namespace {

/// Values one after another; the format is described in inputs.py.
class Reader {
 public:
  explicit Reader(const std::string& path) : path_(path), file_(path, std::ios::binary) {
    if (!file_) throw std::runtime_error(path + ": cannot be read");
  }
  template <class T>
  void read(T* out, std::size_t n) {
    file_.read(reinterpret_cast<char*>(out), static_cast<std::streamsize>(n * sizeof(T)));
    if (!file_) throw std::runtime_error(path_ + ": ends early");
  }
  template <class T>
  T one() {
    T value;
    read(&value, 1);
    return value;
  }
  int count() {
    const auto n = one<std::int32_t>();
    if (n < 0) throw std::runtime_error(path_ + ": a negative count");
    return n;
  }
  std::string text() {
    std::string text(static_cast<std::size_t>(count()), '\0');
    read(text.data(), text.size());
    return text;
  }
  Pose pose() {
    Eigen::Matrix<double, 4, 4, Eigen::RowMajor> T;
    read(T.data(), 16);
    Pose pose;
    pose.matrix() = T;
    return pose;
  }
  Points points(int n) {
    Points points(n, 3);
    read(points.data(), static_cast<std::size_t>(points.size()));
    return points;
  }
  void expect(const std::string& mark) {
    std::string found(mark.size(), '\0');
    read(found.data(), found.size());
    if (found != mark) throw std::runtime_error(path_ + ": '" + mark + "' expected");
  }

 private:
  std::string path_;
  std::ifstream file_;
};

RobotSpec read_robot(Reader& in) {
  RobotSpec spec;
  spec.name = in.text();
  spec.joints.resize(static_cast<std::size_t>(in.count()));
  for (JointSpec& joint : spec.joints) {
    joint.name = in.text();
    joint.type = in.one<std::int32_t>() == 0 ? JointType::kRevolute : JointType::kPrismatic;
    joint.parent = in.one<std::int32_t>();
    joint.origin = in.pose();
    in.read(joint.axis.data(), 3);
    for (double* limit : {&joint.q_min, &joint.q_max, &joint.qd_max, &joint.qdd_max})
      *limit = in.one<double>();
  }
  spec.tool = in.text();
  spec.tool_joint = in.one<std::int32_t>();
  spec.T_JT = in.pose();
  spec.links.resize(static_cast<std::size_t>(in.count()));
  for (LinkSpec& link : spec.links) {
    link.name = in.text();
    link.joint = in.one<std::int32_t>();
    link.T_JL = in.pose();
    link.mesh_error = in.one<double>();
    link.vertices_L = in.points(in.count());
    link.triangles.resize(in.count(), 3);
    in.read(link.triangles.data(), static_cast<std::size_t>(link.triangles.size()));
  }
  return spec;
}

Skin read_skin(Reader& in, const RobotSpec& spec) {
  Skin skin;
  SensorModel& model = skin.model;
  for (double* value : {&model.field_of_view, &model.min_range, &model.max_range, &model.workspace,
                        &model.sigma_floor, &model.sigma_ratio})
    *value = in.one<double>();
  model.range_model = in.one<std::int32_t>() == 0 ? RangeModel::kTangent : RangeModel::kPrinted;
  skin.mounts.resize(static_cast<std::size_t>(in.count()));
  for (Mount& mount : skin.mounts) {
    mount.name = in.text();
    mount.link = spec.links.at(static_cast<std::size_t>(in.one<std::int32_t>())).name;
    mount.T_LS = in.pose();
  }
  return skin;
}

}  // namespace

int Cell::vertices() const {
  Eigen::Index most = 0;
  for (int link = 0; link < robot->n_links(); ++link)
    most = std::max(most, robot->tree(link).vertices_L().rows());
  return static_cast<int>(most);
}

Cell read_cell(const std::string& path) {
  Reader in(path);
  in.expect("PXBENCH1");
  Cell cell;
  cell.name = std::filesystem::path(path).stem();
  RobotSpec spec = read_robot(in);
  JointVector q(static_cast<Eigen::Index>(spec.joints.size()));
  in.read(q.data(), static_cast<std::size_t>(q.size()));
  std::vector<Pose> T_WL;
  for (std::size_t link = 0; link < spec.links.size(); ++link) T_WL.push_back(in.pose());
  cell.goal = in.pose();
  cell.skin = read_skin(in, spec);
  cell.robot = std::make_shared<Robot>(std::move(spec));
  cell.posture = cell.robot->make_posture();
  cell.robot->update(q, cell.posture);
  for (std::size_t link = 0; link < T_WL.size(); ++link) {
    if (!cell.posture.T_WL[link].isApprox(T_WL[link], 1e-9))
      throw std::runtime_error(path + ": the links stand elsewhere than in Python");
  }
  cell.scans.resize(static_cast<std::size_t>(in.count()));
  for (Scan& scan : cell.scans) {
    scan.sensor = in.one<std::int32_t>();
    scan.counter = in.one<std::uint32_t>();
    scan.stamp = in.one<double>();
    in.read(scan.ranges.data(), scan.ranges.size());
    in.read(scan.status.data(), scan.status.size());
  }
  const int n = in.count();
  cell.origins_W = in.points(n);
  cell.points_W = in.points(n);
  cell.tolerance.resize(static_cast<std::size_t>(n));
  in.read(cell.tolerance.data(), cell.tolerance.size());
  cell.min_hit = in.one<double>();
  cell.kept.resize(static_cast<std::size_t>(n));
  in.read(cell.kept.data(), cell.kept.size());
  cell.environment_W = in.points(in.count());
  cell.distance = in.one<double>();
  in.expect("PXBENCHE");
  return cell;
}

}  // namespace proxcgal::bench
