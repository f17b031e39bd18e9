// C interface to the RTAB-Map core that the wheel `depthai` carries (BSD-3-Clause, 0.21.12 in depthai 3.12.0).
//
// The wheel links RTAB-Map and OpenCV 4 into libdepthaicore and exports the functions of namespace rtabmap. A call needs
// the mangled name and the calling convention, no header: this file declares, in its own words, what it calls. A wrong
// name, namespace or parameter type is an undefined symbol, which the loader refuses (RTLD_NOW). Not part of a name,
// hence assumed here and checked by nothing but the tests, for depthai 3.12.0 on x86-64 Linux (Itanium C++ ABI):
//
//   1. std::string, std::map and std::vector are those of libstdc++ with the C++11 ABI.
//   2. cv::Mat is the 96-byte structure of OpenCV 4; `block == nullptr` says that the caller owns the memory.
//   3. rtabmap::Transform holds one cv::Mat (3x4 float, row-major) and nothing else, is not polymorphic, and is passed
//      and returned through a hidden pointer. An unknown pose is empty or all zero.
//   4. rtabmap::Link begins with {int from; int to; Transform; int type}. It is read in place, never made or copied.
//   5. CameraModel, SensorData and Rtabmap are constructed inside storage that is larger than they are (a build of
//      RTAB-Map 0.23.8 has 720, 2944 and 6376 bytes) and destroyed by name.
//   6. Odometry::process is not virtual and takes a null OdometryInfo.
//   7. Odometry (frame to map, Odom/Strategy 0) and map may look at the images of a few calls before; the images of
//      the last kImages calls are kept.
//
// ~cv::Mat is not exported, so a Transform that RTAB-Map returns is never freed (some 250 bytes a frame), nor is an
// odometry that was replaced: the process that loads this file is meant to end with the sequence.

#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <exception>
#include <map>
#include <string>
#include <vector>

namespace cv {

struct Mat {
  static constexpr int kMagic = 0x42FF0000, kContinuous = 1 << 14;
  static constexpr int kBytes3 = 16, kFloat = 5;  // CV_8UC3, CV_32FC1

  int flags, dims, rows, cols;
  unsigned char *data;
  const unsigned char *data_begin, *data_end, *data_limit;
  void *allocator, *block;
  int *size;          // points at rows
  std::size_t *step;  // points at steps
  std::size_t steps[2];

  Mat() {
    std::memset(static_cast<void *>(this), 0, sizeof *this);
    flags = kMagic;
    size = &rows;
    step = steps;
  }
  Mat(int height, int width, int type, std::size_t pixel_bytes, void *pixels) : Mat() {
    flags = kMagic | kContinuous | type;
    dims = 2;
    rows = height;
    cols = width;
    steps[0] = pixel_bytes * width;
    steps[1] = pixel_bytes;
    data = static_cast<unsigned char *>(pixels);
    data_begin = data;
    data_end = data_limit = data + height * steps[0];
  }
  Mat(const Mat &);  // never called; with ~Mat it makes the type one that is passed by a hidden pointer
  ~Mat() {}
};
static_assert(sizeof(Mat) == 96, "cv::Mat of OpenCV 4");

template <class T>
struct Size_ {
  T width, height;
};

}  // namespace cv

class ULogger {
 public:
  enum Type { kTypeNoLog, kTypeConsole };
  enum Level { kDebug, kInfo, kWarning };
  static void setType(Type, const std::string &file, bool append);
  static Level level_;
  static bool printColored_;
};

namespace rtabmap {

using ParametersMap = std::map<std::string, std::string>;

class Parameters {
 public:
  static ParametersMap parameters_;
  static std::string getType(const std::string &name);
  static std::string getVersion();
};

class Transform {
 public:
  Transform();
  Transform(const Transform &other) { share(other); }
  Transform &operator=(const Transform &other) {
    share(other);
    return *this;
  }
  ~Transform() {}
  static Transform getIdentity();

  cv::Mat matrix;

 private:
  void share(const Transform &other) {
    std::memcpy(static_cast<void *>(this), &other, sizeof *this);
    matrix.size = &matrix.rows;  // what points into the object must point into this one
    matrix.step = matrix.steps;
  }
};
static_assert(sizeof(Transform) == sizeof(cv::Mat), "a Transform is one cv::Mat");

struct Link {
  int from, to;
  Transform transform;
  int type;
  Link(const Link &) = delete;
  ~Link() {}
};

class CameraModel {
 public:
  CameraModel(double fx, double fy, double cx, double cy, const Transform &local, double tx,
              const cv::Size_<int> &size);
  ~CameraModel();
  alignas(16) char storage[8192];
};

class SensorData {
 public:
  SensorData(const cv::Mat &bgr, const cv::Mat &depth, const CameraModel &, int id, double stamp,
             const cv::Mat &user_data);
  ~SensorData();
  alignas(16) char storage[16384];
};

class OdometryInfo;
class Signature;

class Odometry {
 public:
  static Odometry *create(const ParametersMap &);
  Transform process(SensorData &, OdometryInfo *);
};

class Rtabmap {
 public:
  Rtabmap();
  ~Rtabmap();
  void init(const ParametersMap &, const std::string &database, bool allow_no_detector);
  void triggerNewMap();
  bool process(const SensorData &, Transform odometry, float linear_variance, float angular_variance,
               const std::vector<float> &velocity, const std::map<std::string, float> &statistics);
  int getLastLocationId() const;
  Transform getPose(int id) const;
  void getGraph(std::map<int, Transform> &, std::multimap<int, Link> &, bool optimized, bool global,
                std::map<int, Signature> *, bool, bool, bool, bool, bool, bool) const;
  void close(bool save, const std::string &database);
  alignas(16) char storage[131072];
};

}  // namespace rtabmap

namespace {

constexpr std::size_t kImages = 16;
constexpr float kOdometryVariance = 1e-4f;  // (1 cm)^2 and (0.01 rad)^2 a link: RTAB-Map's own cannot be read

struct Image {
  std::vector<unsigned char> bgr;
  std::vector<float> depth;
};

struct Slam {
  rtabmap::ParametersMap parameters;
  int width, height;
  rtabmap::CameraModel *camera;
  rtabmap::Odometry *odometry;
  rtabmap::Rtabmap *map;
  rtabmap::Transform pose;  // of the last frame, by odometry
  std::array<Image, kImages> images;
  std::size_t image = 0;
  std::map<int, rtabmap::Transform> nodes;
  std::multimap<int, rtabmap::Link> links;

  // Sensor data on images that stay for the next kImages calls; no features in it, whatever odometry found.
  rtabmap::SensorData sense(int id, double stamp, const unsigned char *bgr, const float *depth) {
    const std::size_t pixels = static_cast<std::size_t>(width) * height;
    Image &kept = images[image++ % kImages];
    kept.bgr.assign(bgr, bgr + 3 * pixels);
    kept.depth.assign(depth, depth + pixels);
    const cv::Mat colour(height, width, cv::Mat::kBytes3, 3, kept.bgr.data());
    const cv::Mat distance(height, width, cv::Mat::kFloat, sizeof(float), kept.depth.data());
    return rtabmap::SensorData(colour, distance, *camera, id, stamp, cv::Mat());
  }
};

// Writes rows of [R | t]; false when the pose is unknown.
bool write_pose(const rtabmap::Transform &transform, double *pose) {
  const auto *values = reinterpret_cast<const float *>(transform.matrix.data);
  double magnitude = 0;
  for (int i = 0; i < 12; ++i) {
    pose[i] = values ? values[i] : 0;
    magnitude += std::fabs(pose[i]);
  }
  return std::isfinite(magnitude) && magnitude > 0;
}

std::string failure;

template <class Work>
int guarded(Work work) {
  try {
    return work();
  } catch (const std::exception &error) {
    failure = error.what();
  } catch (...) {
    failure = "an exception of unknown type";
  }
  return -1;
}

}  // namespace

// All functions return -1 when RTAB-Map threw; bridge_failure then says what.
extern "C" {

const char *bridge_failure() { return failure.c_str(); }

// "0.21.12", then a line "name<tab>type<tab>default" for each parameter that RTAB-Map knows.
const char *bridge_parameters() {
  static std::string text;
  guarded([] {
    text = rtabmap::Parameters::getVersion();
    for (const auto &entry : rtabmap::Parameters::parameters_)
      text += "\n" + entry.first + "\t" + rtabmap::Parameters::getType(entry.first) + "\t" + entry.second;
    return 0;
  });
  return text.c_str();
}

// parameters: name, value, name, value, ... null. Null is returned when RTAB-Map threw.
void *bridge_open(const char *const *parameters, const char *database, int width, int height, double fx, double fy,
                  double cx, double cy) {
  auto *slam = new Slam;
  const int opened = guarded([&] {
    ULogger::level_ = ULogger::kWarning;
    ULogger::printColored_ = false;
    ULogger::setType(ULogger::kTypeConsole, "", true);
    for (; *parameters; parameters += 2) slam->parameters[parameters[0]] = parameters[1];
    slam->width = width;
    slam->height = height;
    // The body's frame is the camera's optical frame: poses are of the camera.
    slam->camera = new rtabmap::CameraModel(fx, fy, cx, cy, rtabmap::Transform::getIdentity(), 0.0,
                                            cv::Size_<int>{width, height});
    slam->odometry = rtabmap::Odometry::create(slam->parameters);
    slam->map = new rtabmap::Rtabmap();
    slam->map->init(slam->parameters, database, false);
    return 0;
  });
  return opened == 0 ? slam : nullptr;
}

// 1 and the pose of the camera in the frame of the first image since the start of this odometry, or 0 when lost.
int bridge_track(void *handle, int id, double stamp, const unsigned char *bgr, const float *depth, double *pose) {
  auto &slam = *static_cast<Slam *>(handle);
  return guarded([&] {
    rtabmap::SensorData data = slam.sense(id, stamp, bgr, depth);
    slam.pose = slam.odometry->process(data, nullptr);
    return static_cast<int>(write_pose(slam.pose, pose));
  });
}

// A new odometry, which starts anywhere, and a new map until a loop closure joins it to the old one.
int bridge_restart(void *handle) {
  auto &slam = *static_cast<Slam *>(handle);
  return guarded([&] {
    slam.odometry = rtabmap::Odometry::create(slam.parameters);
    slam.map->triggerNewMap();
    return 0;
  });
}

// The last tracked image as a node of the map, with another depth. 1 and its optimised pose, or 0 when it is not kept.
int bridge_map(void *handle, int id, double stamp, const unsigned char *bgr, const float *depth, double *pose) {
  auto &slam = *static_cast<Slam *>(handle);
  return guarded([&] {
    slam.map->process(slam.sense(id, stamp, bgr, depth), slam.pose, kOdometryVariance, kOdometryVariance, {}, {});
    return slam.map->getLastLocationId() == id ? static_cast<int>(write_pose(slam.map->getPose(id), pose)) : 0;
  });
}

// Closes the database and counts the nodes and links of the optimised graph, for bridge_graph.
int bridge_finish(void *handle, int *nodes, int *links) {
  auto &slam = *static_cast<Slam *>(handle);
  return guarded([&] {
    if (slam.map->getLastLocationId() > 0)
      slam.map->getGraph(slam.nodes, slam.links, true, true, nullptr, false, false, false, false, false, false);
    *nodes = static_cast<int>(slam.nodes.size());
    *links = static_cast<int>(slam.links.size());
    slam.map->close(true, "");
    return 0;
  });
}

// Node rows: id, pose[12]. Link rows: from, to, type (0 neighbour, 1 global, 2 and 3 proximity), pose[12] of `to` in
// `from`.
void bridge_graph(void *handle, double *node_rows, double *link_rows) {
  const auto &slam = *static_cast<Slam *>(handle);
  for (const auto &entry : slam.nodes) {
    node_rows[0] = entry.first;
    write_pose(entry.second, node_rows + 1);
    node_rows += 13;
  }
  for (const auto &entry : slam.links) {
    link_rows[0] = entry.second.from;
    link_rows[1] = entry.second.to;
    link_rows[2] = entry.second.type;
    write_pose(entry.second.transform, link_rows + 3);
    link_rows += 15;
  }
}

}  // extern "C"
