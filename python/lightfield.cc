// SPDX-License-Identifier: LGPL-2.1-or-later
// The Python module `lightfield`: the API of lightfield/lightfield.h. Images are NumPy arrays that share their memory
// with the library, and other Python threads run while the library computes.
#include <lightfield/lightfield.h>

#include <array>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

namespace lightfield {
namespace {

namespace py = pybind11;
using namespace py::literals;

// An object of the library that only one thread may use at a time, with its mutex.
template <typename Object>
struct Locked {
  template <typename... Args>
  explicit Locked(Args&&... args) : object(std::forward<Args>(args)...) {}
  // Calls `use(object)` while other Python threads run.
  template <typename Use>
  auto with(const Use& use) {
    const py::gil_scoped_release others_run;
    const std::lock_guard lock(mutex);
    return use(object);
  }
  Object object;
  std::mutex mutex;
};

// Refers to a plane in the memory of an array: (height, width, 3) if `rgb`, otherwise (height, width). Throws an Error
// that begins with `name` if this is impossible without a copy.
py::array plane_of(const py::handle& object, const std::string& name, bool rgb) {
  const std::string shape = rgb ? "(height, width, 3)" : "(height, width)";
  if (!py::isinstance<py::array_t<uint8_t>>(object))
    throw Error(name + ": must be a uint8 array of the shape " + shape);
  auto plane = py::reinterpret_borrow<py::array>(object);
  if (plane.ndim() != (rgb ? 3 : 2) || (rgb && plane.shape(2) != 3))
    throw Error(name + ": must have the shape " + shape);
  const py::ssize_t pixel = rgb ? 3 : 1;
  if (plane.strides(1) != pixel || (rgb && plane.strides(2) != 1) || plane.strides(0) < pixel * plane.shape(1))
    throw Error(name + ": the pixels of a row must be adjacent; use numpy.ascontiguousarray()");
  return plane;
}

// Refers to the memory of an RGB array or of a tuple (Y, Cb, Cr). `View` is ImageView or MutableImageView.
template <typename View>
View view_of(const py::handle& object, const std::string& name) {
  const bool rgb = !py::isinstance<py::tuple>(object);
  if (!rgb && py::len(object) != 3) throw Error(name + ": a tuple must have the three arrays Y, Cb and Cr");
  View view;
  view.format = rgb ? PixelFormat::kRgb : PixelFormat::kI420;
  for (int c = 0; c < (rgb ? 1 : 3); c++) {
    py::array plane =
        plane_of(rgb ? py::object(py::reinterpret_borrow<py::object>(object)) : object[py::int_(c)], name, rgb);
    const auto height = static_cast<int>(plane.shape(0)), width = static_cast<int>(plane.shape(1));
    if (c == 0) {
      view.height = height;
      view.width = width;
    } else if (height != (view.height + 1) / 2 || width != (view.width + 1) / 2) {
      throw Error(name + ": Cb and Cr must have half the width and height of Y, rounded up");
    }
    if constexpr (std::is_same_v<View, ImageView>) {
      view.plane[c] = static_cast<const uint8_t*>(plane.data());
    } else {
      if (!plane.writeable()) throw Error(name + ": must be writeable");
      view.plane[c] = static_cast<uint8_t*>(plane.mutable_data());
    }
    view.stride[c] = plane.strides(0);
  }
  return view;
}

// Refers to the arrays in `images`, which must be kept until the views are no longer used.
std::vector<ImageView> views_of(const py::tuple& images) {
  std::vector<ImageView> views;
  for (size_t i = 0; i < images.size(); i++) {
    const py::object image = images[i];
    views.push_back(image.is_none() ? ImageView() : view_of<ImageView>(image, "images[" + std::to_string(i) + "]"));
  }
  return views;
}

// Moves an image into an array, or into a tuple of arrays that share one memory block.
py::object to_numpy(Image image) {
  const auto* owned = new Image(std::move(image));
  const py::capsule owner(owned, [](void* pixels) { delete static_cast<Image*>(pixels); });
  const MutableImageView view(*const_cast<Image*>(owned));
  const py::ssize_t height = view.height, width = view.width, half_height = (height + 1) / 2,
                    half_width = (width + 1) / 2;
  if (view.format == PixelFormat::kRgb)
    return py::array_t<uint8_t>({height, width, py::ssize_t{3}}, view.plane[0], owner);
  return py::make_tuple(py::array_t<uint8_t>({height, width}, view.plane[0], owner),
                        py::array_t<uint8_t>({half_height, half_width}, view.plane[1], owner),
                        py::array_t<uint8_t>({half_height, half_width}, view.plane[2], owner));
}

// Calls `make()`, or `make_into(view of out)` if the caller has passed `out`, and returns the picture.
template <typename Make, typename MakeInto>
py::object picture(const py::object& out, const Make& make, const MakeInto& make_into) {
  if (out.is_none()) return to_numpy(make());
  make_into(view_of<MutableImageView>(out, "out"));
  return out;
}

Bytes to_bytes(const py::bytes& message) {
  const std::string_view text = message;
  return {text.begin(), text.end()};
}
py::bytes from_bytes(const Bytes& message) { return {reinterpret_cast<const char*>(message.data()), message.size()}; }

std::array<double, 3> from_vec(const Vec3& v) { return {v.x, v.y, v.z}; }
Vec3 to_vec(const std::array<double, 3>& v) { return {v[0], v[1], v[2]}; }
std::array<double, 4> from_quaternion(const Quaternion& q) { return {q.w, q.x, q.y, q.z}; }
Quaternion to_quaternion(const std::array<double, 4>& q) { return {q[0], q[1], q[2], q[3]}; }
Colour to_colour(const std::tuple<uint8_t, uint8_t, uint8_t>& rgb) {
  return {std::get<0>(rgb), std::get<1>(rgb), std::get<2>(rgb)};
}

// Sets the attributes of `object` that the caller has passed as keywords.
template <typename Object>
Object from_keywords(const py::kwargs& keywords) {
  py::object made = py::cast(Object());
  for (const auto& [key, value] : keywords) {
    if (!py::hasattr(made, key)) throw py::type_error("no attribute " + std::string(py::str(key)));
    py::setattr(made, key, value);
  }
  return made.cast<Object>();
}

// Defines the attributes `position` and `orientation` of a class with a pose.
template <typename Class, typename Object>
void define_pose(Class& type, Pose Object::*pose) {
  type.def_property(
      "position", [pose](const Object& o) { return from_vec((o.*pose).position); },
      [pose](Object& o, const std::array<double, 3>& v) { (o.*pose).position = to_vec(v); },
      "Centre of projection in the world, (x, y, z), metres.");
  type.def_property(
      "orientation", [pose](const Object& o) { return from_quaternion((o.*pose).orientation); },
      [pose](Object& o, const std::array<double, 4>& q) { (o.*pose).orientation = to_quaternion(q); },
      "Unit quaternion (w, x, y, z), which rotates camera axes to world axes.");
}

void define_values(py::module_& m) {
  py::enum_<Focus>(m, "Focus", "Subject in focus: the plane at focus_distance, or an estimated surface.")
      .value("PLANE", Focus::kPlane)
      .value("AUTO", Focus::kAuto);
  py::enum_<Resampling>(m, "Resampling", "BILINEAR is fastest; SHARPENED restores detail that bilinear sampling loses.")
      .value("BILINEAR", Resampling::kBilinear)
      .value("SHARPENED", Resampling::kSharpened);
  py::enum_<RendererChoice>(m, "RendererChoice", "Device that renders pictures.")
      .value("CPU", RendererChoice::kCpu)
      .value("GL", RendererChoice::kGl)
      .value("AUTO", RendererChoice::kAuto);
  py::enum_<Topology::Type>(m, "Topology", "How the array is divided into triangles of cameras.")
      .value("DELAUNAY", Topology::Type::kDelaunay)
      .value("GRID", Topology::Type::kGrid)
      .value("TRIANGLES", Topology::Type::kTriangles);

  py::class_<Lens> lens(m, "Lens",
                        "Maps camera coordinates to pixels, like OpenCV. (0, 0) is the centre of the top-left pixel.");
  lens.def(py::init(&from_keywords<Lens>));
  for (const auto& [name, member] : {std::pair("fx", &Lens::fx),
                                     {"fy", &Lens::fy},
                                     {"cx", &Lens::cx},
                                     {"cy", &Lens::cy},
                                     {"k1", &Lens::k1},
                                     {"k2", &Lens::k2},
                                     {"p1", &Lens::p1},
                                     {"p2", &Lens::p2},
                                     {"k3", &Lens::k3},
                                     {"k4", &Lens::k4},
                                     {"k5", &Lens::k5},
                                     {"k6", &Lens::k6},
                                     {"s1", &Lens::s1},
                                     {"s2", &Lens::s2}})
    lens.def_readwrite(name, member);
  lens.def_readwrite("fisheye", &Lens::fisheye);

  py::class_<Camera> camera(
      m, "Camera", "A camera of a rig. width and height are in pixels; image and source are relative to the rig file.");
  camera.def(py::init(&from_keywords<Camera>))
      .def_readwrite("id", &Camera::id)
      .def_readwrite("name", &Camera::name)
      .def_readwrite("width", &Camera::width)
      .def_readwrite("height", &Camera::height)
      .def_readwrite("lens", &Camera::lens)
      .def_readwrite("image", &Camera::image)
      .def_readwrite("source", &Camera::source);
  define_pose(camera, &Camera::world_from_camera);

  py::class_<View> view(m, "View", "A virtual camera.");
  view.def(py::init(&from_keywords<View>))
      .def_readwrite("width", &View::width, "Pixels.")
      .def_readwrite("height", &View::height, "Pixels.")
      .def_readwrite("fov_y", &View::fov_y, "Vertical field of view, degrees.")
      .def_readwrite("lens", &View::lens, "A Lens that replaces fov_y, or None.")
      .def_readwrite("focus_distance", &View::focus_distance, "Distance of the plane in focus, metres.")
      .def_readwrite("aperture", &View::aperture,
                     "Diameter of the simulated lens, metres; 0: three cameras per pixel.");
  define_pose(view, &View::world_from_view);
  m.def("home_view", &home_view, "rig"_a, "width"_a, "height"_a,
        "Returns a View from the middle of the cameras. Sizes are in pixels.");
  m.def(
      "look_at",
      [](const std::array<double, 3>& eye, const std::array<double, 3>& target) {
        return from_quaternion(look_at(to_vec(eye), to_vec(target)).orientation);
      },
      "eye"_a, "target"_a,
      "Returns the orientation (w, x, y, z) at `eye` that looks at `target` without roll. Metres.");
}

void define_rig(py::module_& m) {
  py::class_<Rig>(m, "Rig", "An immutable camera array. Cameras have the indices 0 to len(rig) - 1.")
      .def(py::init([](const std::vector<Camera>& cameras, Topology::Type topology, int rows, int columns,
                       const std::vector<std::array<uint32_t, 3>>& triangles) {
             return Rig(cameras, {topology, rows, columns, triangles});
           }),
           "cameras"_a, "topology"_a = Topology::Type::kDelaunay, "rows"_a = 0, "columns"_a = 0,
           "triangles"_a = std::vector<std::array<uint32_t, 3>>(),
           "Creates a rig from Camera objects. rows and columns are for Topology.GRID, triangles for "
           "Topology.TRIANGLES.")
      .def("__len__", &Rig::size)
      .def("camera", &Rig::camera, "index"_a, "Returns a copy of a camera.")
      .def_property_readonly("hash", &Rig::hash)
      .def("json", &Rig::json, "Returns the text of a rig file.")
      .def(
          "save", [](const Rig& rig, const std::string& path) { save_rig(rig, path); }, "path"_a, "Writes a rig file.");
  m.def("load_rig", &load_rig, "path"_a, "Reads a rig file.");
  m.def("parse_rig", &parse_rig, "json"_a, "name"_a = "rig", "Parses the text of a rig file. Errors show `name`.");
}

constexpr const char* kRenderDocumentation =
    "Renders the picture of a virtual camera, and returns it in the format of the images.\n\n"
    "images: one for each camera of the rig, in this order. Each is an RGB array of uint8 with the shape (height, "
    "width,\n"
    "  3), a tuple (Y, Cb, Cr) of uint8 arrays in full-range BT.601 with chroma of half the width and height, or "
    "None.\n"
    "  Pixels are not copied, so rows must be contiguous, and the arrays must not change during the call.\n"
    "focus, nearest, farthest: Focus, and the range of the distances that Focus.AUTO searches, metres (0: automatic).\n"
    "match_brightness: whether Focus.AUTO corrects brightness differences between cameras (None: automatic).\n"
    "background: colour (R, G, B) of pixels that no camera sees, 0 to 255.\n"
    "out: array (or tuple of arrays) of the view's size to write the picture into.";

void define_renderer(py::module_& m) {
  using Type = Locked<Renderer>;
  py::class_<Type>(m, "Renderer", "Renders the pictures of one viewer from images in this process. Thread-safe.")
      .def(py::init([](const Rig& rig, unsigned threads) { return std::make_unique<Type>(rig, threads); }), "rig"_a,
           "threads"_a = 0, "Creates a renderer. `threads` is the maximum number of threads; 0: number of processors.")
      .def(
          "render",
          [](Type& self, const View& view, const py::sequence& images, Focus focus, double nearest, double farthest,
             std::optional<bool> match_brightness, Resampling resampling,
             const std::tuple<uint8_t, uint8_t, uint8_t>& background, RendererChoice renderer, const py::object& out) {
            RenderOptions options;
            options.focus = focus;
            options.nearest = nearest;
            options.farthest = farthest;
            options.match_brightness = match_brightness;
            options.resampling = resampling;
            options.background = to_colour(background);
            options.renderer = renderer;
            const py::tuple kept(images);  // another thread may change the list
            const std::vector<ImageView> frames = views_of(kept);
            return picture(
                out, [&] { return self.with([&](Renderer& r) { return r.render(view, frames, options); }); },
                [&](const MutableImageView& to) {
                  self.with([&](Renderer& r) { r.render_into(view, frames, to, options); });
                });
          },
          "view"_a, "images"_a, py::kw_only(), "focus"_a = Focus::kPlane, "nearest"_a = 0, "farthest"_a = 0,
          "match_brightness"_a = py::none(), "resampling"_a = Resampling::kSharpened,
          "background"_a = py::make_tuple(0, 0, 0), "renderer"_a = RendererChoice::kCpu, "out"_a = py::none(),
          kRenderDocumentation)
      .def(
          "cameras",
          [](Type& self, const View& view) { return self.with([&](Renderer& r) { return r.cameras(view); }); },
          "view"_a, "Returns the indices of the cameras that contribute to a view.")
      .def_property_readonly(
          "drawn_by", [](Type& self) { return self.with([](Renderer& r) { return r.drawn_by(); }); },
          "The device that rendered the latest picture, and the reason.")
      .def(
          "reset_focus", [](Type& self) { self.with([](Renderer& r) { r.reset_focus(); }); },
          "Discards the focal surface.");
}

void define_node(py::module_& m) {
  m.attr("NEWEST") = kNewest;
  m.def(
      "read_request",
      [](const py::bytes& request) {
        const RequestInfo info = read_request(to_bytes(request));
        return py::make_tuple(info.view_id, info.sequence, info.time);
      },
      "request"_a, "Returns (view_id, sequence, time) of a request. The time is in nanoseconds, or NEWEST.");
  py::class_<Node>(m, "Node", "Serves the cameras of one machine. Thread-safe.")
      .def(py::init([](const Rig& rig, std::vector<uint32_t> cameras, Resampling resampling, unsigned threads) {
             NodeOptions options;
             options.resampling = resampling;
             options.threads = threads;
             return Node(rig, std::move(cameras), options);
           }),
           "rig"_a, "cameras"_a, py::kw_only(), "resampling"_a = Resampling::kSharpened, "threads"_a = 0,
           "Creates a node for the cameras with these indices.")
      .def_property_readonly("cameras", &Node::cameras)
      .def(
          "cameras_for", [](const Node& node, const py::bytes& request) { return node.cameras_for(to_bytes(request)); },
          "request"_a, "Returns the indices of the node's cameras that contribute to a request (bytes).")
      .def(
          "answer",
          [](const Node& node, const py::bytes& request, const py::sequence& frames) {
            const py::tuple kept(frames);  // another thread may change the list
            const std::vector<ImageView> views = views_of(kept);
            const Bytes message = to_bytes(request);
            std::vector<Bytes> parts;
            {
              const py::gil_scoped_release others_run;
              parts = node.answer(message, views);
            }
            py::list out;
            for (const Bytes& part : parts) out.append(from_bytes(part));
            return out;
          },
          "request"_a, "frames"_a,
          "Answers a request (bytes) with a list of messages (bytes), which must all be sent to the viewer. `frames` "
          "has one\n"
          "image for each of `cameras`, as in Renderer.render().");
}

void define_compositor(py::module_& m) {
  using Type = Locked<Compositor>;
  py::class_<Type>(m, "Compositor", "Shows the cameras of remote nodes to one viewer. Thread-safe.")
      .def(py::init([](const Rig& rig, uint32_t view_id) { return std::make_unique<Type>(rig, view_id); }), "rig"_a,
           "view_id"_a, "Creates a compositor. `view_id` must be unique among the viewers of the same nodes.")
      .def(
          "request",
          [](Type& self, const View& view, Focus focus, double nearest, double farthest,
             std::optional<bool> match_brightness, int quality, uint64_t time, std::vector<uint32_t> out_of_service,
             const std::tuple<uint8_t, uint8_t, uint8_t>& background) {
            RequestOptions options;
            options.focus = focus;
            options.nearest = nearest;
            options.farthest = farthest;
            options.match_brightness = match_brightness;
            options.quality = quality;
            options.time = time;
            options.out_of_service = std::move(out_of_service);
            options.background = to_colour(background);
            return from_bytes(self.with([&](Compositor& c) { return c.request(view, options); }));
          },
          "view"_a, py::kw_only(), "focus"_a = Focus::kPlane, "nearest"_a = 0, "farthest"_a = 0,
          "match_brightness"_a = py::none(), "quality"_a = 90, "time"_a = kNewest,
          "out_of_service"_a = std::vector<uint32_t>(), "background"_a = py::make_tuple(0, 0, 0),
          "Begins the next picture, and returns its request (bytes) for every node.\n\n"
          "quality: JPEG quality, 1 to 100, or 0 for uncompressed sums.\n"
          "time: capture time of the frames, nanoseconds of a clock that all nodes share, or NEWEST.\n"
          "The remaining options are as in Renderer.render().")
      .def(
          "add",
          [](Type& self, const py::bytes& part) {
            const Bytes message = to_bytes(part);
            return self.with([&](Compositor& c) { return c.add(message); }).problem;
          },
          "part"_a, "Adds a part of an answer (bytes). Returns '', or the reason why the part was not added.")
      .def_property_readonly(
          "is_complete", [](Type& self) { return self.with([](Compositor& c) { return c.is_complete(); }); },
          "True if the nodes of all cameras in service have answered.")
      .def(
          "finish",
          [](Type& self, const py::object& out) {
            return picture(
                out, [&] { return self.with([](Compositor& c) { return c.finish(); }); },
                [&](const MutableImageView& to) { self.with([&](Compositor& c) { c.finish_into(to); }); });
          },
          "out"_a = py::none(), "Returns the picture from all parts, as in Renderer.render().")
      .def_property_readonly(
          "missing", [](Type& self) { return self.with([](Compositor& c) { return c.missing(); }); },
          "Number of cameras that the latest picture needed but did not get.")
      .def(
          "reset_focus", [](Type& self) { self.with([](Compositor& c) { c.reset_focus(); }); },
          "Discards the focal surface.");
}

}  // namespace

PYBIND11_MODULE(lightfield, m) {
  m.doc() = "Renders views of a virtual camera from the images of a camera array.";
  m.attr("__version__") = version();
  py::register_exception<Error>(m, "Error", PyExc_ValueError);
  define_values(m);
  define_rig(m);
  define_renderer(m);
  define_node(m);
  define_compositor(m);
}

}  // namespace lightfield
