# Third-party libraries, all from the system. Their headers are SYSTEM: warnings are for our code.

# CONFIG, because CGAL ships a FindEigen3 that hides the target.
find_package(Eigen3 3.4 REQUIRED CONFIG)

# Header only, and not by find_package(CGAL): that would link GMP and MPFR, which the kernel used
# here does not need, and add -frounding-math to every file.
find_path(CGAL_INCLUDE_DIR CGAL/version.h REQUIRED)
add_library(proxcgal_cgal INTERFACE)
target_include_directories(proxcgal_cgal SYSTEM INTERFACE ${CGAL_INCLUDE_DIR})

find_package(orocos_kdl REQUIRED)
add_library(proxcgal_kdl INTERFACE)
target_include_directories(proxcgal_kdl SYSTEM INTERFACE ${orocos_kdl_INCLUDE_DIRS})
target_link_libraries(proxcgal_kdl INTERFACE ${orocos_kdl_LIBRARIES})
