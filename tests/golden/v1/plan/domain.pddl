(define (domain mobile_manipulation)
  (:requirements :strips :typing)
  (:types thing - object support - thing item - support surface - support container - support door - thing spot - thing)
  (:predicates
    (near ?a - thing)
    (on ?a - item ?b - support)
    (in ?a - item ?b - container)
    (behind ?a - item ?b - door)
    (entrance ?a - door ?b - container)
    (clear ?a - support)
    (holding ?a - item)
    (hand_empty)
    (open ?a - door)
    (closed ?a - door)
  )
  (:action drive
    :parameters (?from - thing ?to - thing)
    :precondition (and (near ?from))
    :effect (and (near ?to) (not (near ?from))))
  (:action pick
    :parameters (?item - item ?from - support)
    :precondition (and (near ?item) (on ?item ?from) (clear ?item) (hand_empty))
    :effect (and (holding ?item) (clear ?from) (not (on ?item ?from)) (not (hand_empty))))
  (:action take_out
    :parameters (?item - item ?from - container ?door - door)
    :precondition (and (near ?item) (in ?item ?from) (behind ?item ?door) (open ?door) (clear ?item) (hand_empty))
    :effect (and (holding ?item) (not (in ?item ?from)) (not (behind ?item ?door)) (not (hand_empty))))
  (:action place
    :parameters (?item - item ?on - surface)
    :precondition (and (holding ?item) (near ?on))
    :effect (and (on ?item ?on) (hand_empty) (not (holding ?item))))
  (:action put_in
    :parameters (?item - item ?in - container ?door - door)
    :precondition (and (holding ?item) (near ?in) (entrance ?door ?in) (open ?door))
    :effect (and (in ?item ?in) (behind ?item ?door) (hand_empty) (not (holding ?item))))
  (:action open
    :parameters (?door - door)
    :precondition (and (near ?door) (hand_empty))
    :effect (and (open ?door) (not (closed ?door))))
  (:action close
    :parameters (?door - door)
    :precondition (and (near ?door) (hand_empty))
    :effect (and (closed ?door) (not (open ?door))))
)
