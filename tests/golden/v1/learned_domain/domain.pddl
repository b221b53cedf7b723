(define (domain set_table)
  (:requirements :strips :typing)
  (:types )
  (:predicates
    (in_gripper ?a - object)
    (rests_on ?a - object ?b - object)
    (not_there_something_on ?a - object)
    (plate ?a - object)
    (thin_enough ?a - object)
    (be_grasped_by_gripper ?a - object)
    (not_gripper_already_occupied)
    (rests_on_table ?a - object)
  )
  (:action pick_up-1
    :parameters (?a - object ?x - object)
    :precondition (and (be_grasped_by_gripper ?a) (not_gripper_already_occupied) (not_there_something_on ?a) (rests_on ?a ?x))
    :effect (and (in_gripper ?a) (not_there_something_on ?x) (not (not_gripper_already_occupied)) (not (rests_on ?a ?x))))
  (:action pick_up-2
    :parameters (?a - object)
    :precondition (and (be_grasped_by_gripper ?a) (not_gripper_already_occupied) (not_there_something_on ?a) (rests_on_table ?a))
    :effect (and (in_gripper ?a) (not (not_gripper_already_occupied)) (not (rests_on_table ?a))))
  (:action place_first_on_second-1
    :parameters (?a - object ?b - object)
    :precondition (and (in_gripper ?a) (not_there_something_on ?b))
    :effect (and (not_gripper_already_occupied) (rests_on ?a ?b) (not (in_gripper ?a)) (not (not_there_something_on ?b))))
  (:action place_on_table-1
    :parameters (?a - object)
    :precondition (and (in_gripper ?a))
    :effect (and (not_gripper_already_occupied) (rests_on_table ?a) (not (in_gripper ?a))))
  (:action push_plate_on_object-1
    :parameters (?a - object ?b - object)
    :precondition (and (not_gripper_already_occupied) (not_there_something_on ?a) (not_there_something_on ?b) (plate ?a) (rests_on_table ?a) (thin_enough ?b))
    :effect (and (rests_on ?a ?b) (not (not_there_something_on ?b)) (not (rests_on_table ?a))))
)
