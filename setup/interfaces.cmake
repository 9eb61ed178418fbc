# Read by each CMake project of the ROS 2 workspace right after project(): its interface packages generate what Python and the bridge's
# data plane use (C, its type supports, Python), and compile most libraries as one file, for reading headers takes most of the time.
# Fast DDS makes the types' descriptions, which it tells to peers, from the introspection.
set(wanted_generators rosidl_generator_type_description rosidl_generator_c rosidl_typesupport_fastrtps_c
  rosidl_typesupport_introspection_c rosidl_typesupport_c rosidl_generator_py)

# Each find_package() of an interface package registers its generators anew; those that are not wanted are taken out at once.
macro(keep_wanted_generators variable access value current_list_file stack)
  if("${access}" STREQUAL "MODIFIED_ACCESS")
    set(_kept_generators "")
    foreach(_registered_generator IN ITEMS ${value})
      string(REGEX REPLACE ":.*" "" _registered_package "${_registered_generator}")
      if(_registered_package IN_LIST wanted_generators)
        list(APPEND _kept_generators "${_registered_generator}")
      endif()
    endforeach()
    set(AMENT_EXTENSIONS_rosidl_generate_idl_interfaces "${_kept_generators}")
  endif()
endmacro()
variable_watch(AMENT_EXTENSIONS_rosidl_generate_idl_interfaces keep_wanted_generators)

function(compile_libraries_as_one_file)
  get_property(targets DIRECTORY PROPERTY BUILDSYSTEM_TARGETS)
  foreach(target IN LISTS targets)
    if(target MATCHES "__rosidl_(typesupport_c|typesupport_introspection_c|typesupport_fastrtps_c|generator_c|generator_py)$")
      set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 0)
      # Descriptions of two types that hold a third one each define its hash.
      get_target_property(sources ${target} SOURCES)
      list(FILTER sources INCLUDE REGEX "__description\\.c$")
      set_source_files_properties(${sources} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
    endif()
  endforeach()
endfunction()
cmake_language(DEFER CALL compile_libraries_as_one_file)

# Nobody edits what was generated; and each link that ament makes is a process.
if(EXISTS "${CMAKE_CURRENT_SOURCE_DIR}/msg" OR EXISTS "${CMAKE_CURRENT_SOURCE_DIR}/srv" OR EXISTS "${CMAKE_CURRENT_SOURCE_DIR}/action")
  set(AMENT_CMAKE_SYMLINK_INSTALL OFF)
endif()
