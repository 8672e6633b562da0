# For Python alone it leaves out the libraries for C++, which take longer than all else. rosbag2 reads messages by them.
# A package of ROS is read once: so what is taken from its list here is not there later.
if(UAL_FOR_PYTHON_ALONE)
  find_package(ament_cmake REQUIRED)
  find_package(rosidl_default_generators REQUIRED)
  list(FILTER AMENT_EXTENSIONS_rosidl_generate_idl_interfaces EXCLUDE REGEX "_cpp:")
endif()

# Compiles the sources of each library as one: the headers of ROS are read once, which saves a third of the time.
# Those of rosidl_generator_c define the same static names, and stay apart.
function(unite)
  get_property(targets DIRECTORY PROPERTY BUILDSYSTEM_TARGETS)
  foreach(target IN LISTS targets)
    get_target_property(type ${target} TYPE)
    if(type STREQUAL "SHARED_LIBRARY" AND NOT target MATCHES "rosidl_generator_c$")
      set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 0)
    endif()
  endforeach()
endfunction()
cmake_language(DEFER CALL unite)
